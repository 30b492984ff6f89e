// SPDX-License-Identifier: Apache-2.0
//
// A USB camera, opened through libusb without device discovery. The plugin uses only those nodes in /dev/bus/usb
// that it may open, so it works in a sandbox that contains only one node. Functions that fail throw Failure with a
// message for the user.
#pragma once

#include "descriptors.hpp"

#include "camera_common/file_descriptor.hpp"

#include <arhost-cpp/plugin.hpp>

#include <libusb.h>

#include <memory>
#include <optional>

namespace arhost::uvc {

// The text is "VENDOR:PRODUCT" or "VENDOR:PRODUCT:SERIAL", with the IDs in hexadecimal digits as lsusb prints them.
struct UsbIdentity {
    std::uint16_t vendor = 0, product = 0;
    std::string serial; // empty: any
};
std::optional<UsbIdentity> parse_identity(const std::string &text);

class UsbDevice {
public:
    // Opens the camera with this identity, or, if there is no identity, the first camera that can be opened.
    static UsbDevice open(const std::optional<UsbIdentity> &identity);
    struct Connected;
    static std::vector<Connected> list();

    const std::string &name() const { return name_; } // such as "the camera 046d:0825 (/dev/bus/usb/001/004)"
    const Configuration &configuration() const { return configuration_; }
    libusb_context *context() const { return context_.get(); }
    libusb_device_handle *handle() const { return handle_.get(); }

    enum class Driver { none, kernel, user_space };
    Driver driver_of(std::uint8_t interface) const;

    // Takes an interface from the kernel's driver. release() returns the interface to the driver.
    void claim(std::uint8_t interface);
    void release(std::uint8_t interface);
    void set_alternate(std::uint8_t interface, std::uint8_t alternate) const;

    // Sends a request of the video class to an entity (a unit's ID and an interface). Returns the number of bytes
    // received, or a negative libusb error. LIBUSB_ERROR_PIPE means that the camera rejects the request.
    int get(std::uint8_t request, std::uint8_t selector, std::uint16_t entity, std::span<std::uint8_t> data) const;
    int set(std::uint8_t selector, std::uint16_t entity, Bytes data) const;

    // Throws Failure for a libusb error. `what`: the operation that failed ("setting the format").
    [[noreturn]] void fail(const std::string &what, int error) const;
    [[noreturn]] void fail_configuration(const std::string &key, const std::string &what) const;

private:
    struct Node;
    struct ExitContext {
        void operator()(libusb_context *context) const { libusb_exit(context); }
    };
    struct CloseHandle {
        void operator()(libusb_device_handle *handle) const { libusb_close(handle); }
    };

    UsbDevice() = default;
    static std::vector<Node> list_nodes();
    static std::optional<UsbDevice> open_node(Node &node, const std::string &serial);
    void fail_lost() const;

    std::string name_;
    Configuration configuration_;
    FileDescriptor fd_; // closed after the handle, which does not own the descriptor
    std::unique_ptr<libusb_context, ExitContext> context_;
    std::unique_ptr<libusb_device_handle, CloseHandle> handle_;
};

// A connected camera. If it cannot be opened, `device` is absent, and the other members contain the available
// information.
struct UsbDevice::Connected {
    std::string node, id; // "/dev/bus/usb/001/004", "046d:0825"
    std::string product, serial;
    Configuration configuration;
    std::optional<UsbDevice> device;
    std::string problem; // the reason why there is no `device`
};

// bRequest
constexpr std::uint8_t set_current = 0x01, get_current = 0x81, get_minimum = 0x82, get_maximum = 0x83,
                       get_resolution = 0x84, get_length = 0x85, get_info = 0x86, get_default = 0x87;

} // namespace arhost::uvc
