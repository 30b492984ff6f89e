// SPDX-License-Identifier: Apache-2.0
//
// Finds a USB device that the configuration names, and returns it to the kernel's drivers.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace arhost::base {

// A device as "VENDOR:PRODUCT" or "VENDOR:PRODUCT:SERIAL"; both IDs have four hexadecimal digits in lower case.
using UsbIdentity = std::string;
constexpr std::size_t max_usb_identity = 200; // bytes

// The folder of the USB devices in sysfs. Tests use another folder.
constexpr const char *usb_devices = "/sys/bus/usb/devices";

struct UsbDevice {
    std::filesystem::path node;        // such as /dev/bus/usb/001/004
    std::vector<unsigned> driver_less; // numbers of its interfaces that no driver uses
};

// Returns the connected device; if several match, that whose port comes first by name.
std::optional<UsbDevice> find_usb_device(const UsbIdentity &identity,
                                         const std::filesystem::path &devices = usb_devices);

// Makes the kernel's drivers use the interfaces that no driver uses, as after a device is connected. Necessary if a
// process that has taken interfaces with usbfs was killed. May take seconds, because drivers query the device.
void bind_usb_drivers(const UsbDevice &device);

} // namespace arhost::base
