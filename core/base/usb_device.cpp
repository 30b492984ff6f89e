// SPDX-License-Identifier: Apache-2.0
#include "base/usb_device.hpp"

#include "base/unique_fd.hpp"

#include <algorithm>
#include <charconv>
#include <fcntl.h>
#include <fstream>
#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>

namespace arhost::base {
namespace {

namespace fs = std::filesystem;

std::string attribute(const fs::path &device, const char *name) {
    std::string text;
    std::getline(std::ifstream(device / name), text);
    return text;
}

// "1" becomes "001".
std::string padded(const std::string &number) {
    return std::string(3 - std::min<std::size_t>(number.size(), 3), '0') + number;
}

bool is_number(const std::string &text) {
    return !text.empty() && text.size() <= 3 &&
           std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
}

// In the folder that contains the device's folder, each interface has a folder named DEVICE:CONFIGURATION.INTERFACE.
std::vector<unsigned> find_driver_less(const fs::path &devices, const std::string &device) {
    std::vector<unsigned> interfaces;
    std::error_code ignored;
    for (fs::directory_iterator entry(devices, ignored), end; entry != end; entry.increment(ignored)) {
        const std::string name = entry->path().filename();
        if (!name.starts_with(device + ":") || fs::exists(entry->path() / "driver", ignored))
            continue;
        unsigned number = 0;
        const std::size_t dot = name.rfind('.');
        if (dot > device.size() && dot != std::string::npos &&
            std::from_chars(name.data() + dot + 1, name.data() + name.size(), number).ec == std::errc())
            interfaces.push_back(number);
    }
    std::ranges::sort(interfaces);
    return interfaces;
}

} // namespace

std::optional<UsbDevice> find_usb_device(const UsbIdentity &identity, const fs::path &devices) {
    constexpr std::size_t ids_size = 9; // of VENDOR:PRODUCT
    const std::string ids = identity.substr(0, ids_size),
                      serial = identity.size() > ids_size ? identity.substr(ids_size + 1) : "";
    std::string first; // a name in `devices`
    std::error_code ignored;
    for (fs::directory_iterator entry(devices, ignored), end; entry != end; entry.increment(ignored)) {
        const fs::path &device = entry->path();
        const std::string name = device.filename();
        if (attribute(device, "idVendor") + ":" + attribute(device, "idProduct") == ids &&
            (serial.empty() || attribute(device, "serial") == serial) && (first.empty() || name < first))
            first = name;
    }
    if (first.empty())
        return std::nullopt;
    const std::string bus = attribute(devices / first, "busnum"), number = attribute(devices / first, "devnum");
    if (!is_number(bus) || !is_number(number)) // it has just disappeared
        return std::nullopt;
    return UsbDevice{fs::path("/dev/bus/usb") / padded(bus) / padded(number), find_driver_less(devices, first)};
}

void bind_usb_drivers(const UsbDevice &device) {
    const UniqueFd node(::open(device.node.c_str(), O_RDWR | O_CLOEXEC));
    if (!node)
        return;
    for (const unsigned interface : device.driver_less) {
        usbdevfs_ioctl request{static_cast<int>(interface), USBDEVFS_CONNECT, nullptr};
        (void)::ioctl(node.get(), USBDEVFS_IOCTL, &request); // fails if no driver supports the interface
    }
}

} // namespace arhost::base
