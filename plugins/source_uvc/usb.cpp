// SPDX-License-Identifier: Apache-2.0
#include "usb.hpp"

#include <fcntl.h>
#include <glob.h>
#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>

namespace arhost::uvc {
namespace {

constexpr unsigned request_timeout_ms = 2000;

std::optional<std::uint16_t> hexadecimal(std::string_view text) {
    std::uint16_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, 16);
    return error == std::errc() && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

std::string id_text(std::uint16_t vendor, std::uint16_t product) {
    char text[16];
    std::snprintf(text, sizeof text, "%04x:%04x", vendor, product);
    return text;
}

// Returns the device descriptor and the configuration descriptors that the kernel has read from the device.
std::vector<std::uint8_t> read_descriptors(int fd) {
    std::vector<std::uint8_t> bytes(std::size_t{1} << 18);
    std::size_t size = 0;
    for (ssize_t got = 1; got > 0 && size < bytes.size(); size += static_cast<std::size_t>(std::max<ssize_t>(got, 0)))
        got = ::read(fd, bytes.data() + size, bytes.size() - size);
    bytes.resize(size);
    return bytes;
}

// Returns the active configuration, whose bConfigurationValue is `value`, or the first configuration if `value` is 0.
// The kernel stores each configuration with the length that the configuration states.
Configuration find_configuration(Bytes bytes, int value) {
    Configuration first;
    for (bool is_first = true; bytes.size() >= 9; is_first = false) {
        const std::size_t length = std::clamp<std::size_t>(bytes[2] | bytes[3] << 8, 9, bytes.size());
        Configuration found = parse_configuration(bytes.first(length));
        if (found.value == value)
            return found;
        if (is_first)
            first = std::move(found);
        bytes = bytes.subspan(length);
    }
    return first;
}

std::string string_descriptor(libusb_device_handle *handle, std::uint8_t index) {
    unsigned char text[256];
    const int size = index ? libusb_get_string_descriptor_ascii(handle, index, text, sizeof text) : 0;
    std::string result(text, text + std::max(size, 0));
    std::ranges::replace_if(
        result, [](unsigned char c) { return !std::isprint(c); }, '?');
    return result;
}

} // namespace

std::optional<UsbIdentity> parse_identity(const std::string &text) {
    const std::size_t first = text.find(':'), second = text.find(':', first + 1);
    if (first == std::string::npos)
        return std::nullopt;
    const auto vendor = hexadecimal(std::string_view(text).substr(0, first));
    const auto product = hexadecimal(std::string_view(text).substr(first + 1, second - first - 1));
    if (!vendor || !product)
        return std::nullopt;
    return UsbIdentity{*vendor, *product, second == std::string::npos ? "" : text.substr(second + 1)};
}

// A node in /dev/bus/usb.
struct UsbDevice::Node {
    std::string path;
    FileDescriptor fd; // opened for reading and writing; -1: only readable, and `error` states the reason
    int error = 0;
    std::vector<std::uint8_t> descriptors;
    std::uint16_t word(std::size_t at) const {
        return static_cast<std::uint16_t>(descriptors[at] | descriptors[at + 1] << 8);
    }
    std::uint16_t vendor() const { return word(8); }
    std::uint16_t product() const { return word(10); }
    std::uint8_t product_index() const { return descriptors[15]; }
    std::uint8_t serial_index() const { return descriptors[16]; }
    bool is_camera() const { return !find_configuration(Bytes(descriptors).subspan(18), 0).functions.empty(); }
    std::string text() const { return id_text(vendor(), product()) + " (" + path + ")"; }
    std::string why_not_opened() const {
        return std::string("cannot be opened: ") + std::strerror(error) +
               "; a udev rule can permit it: SUBSYSTEM==\"usb\", ATTR{idVendor}==\"" +
               id_text(vendor(), 0).substr(0, 4) + "\", MODE=\"0660\", GROUP=\"video\"";
    }
};

std::vector<UsbDevice::Node> UsbDevice::list_nodes() {
    std::vector<Node> nodes;
    glob_t found{};
    if (glob("/dev/bus/usb/*/*", 0, nullptr, &found) == 0)
        for (std::size_t i = 0; i < found.gl_pathc; ++i) {
            Node node;
            node.path = found.gl_pathv[i];
            node.fd = FileDescriptor(::open(node.path.c_str(), O_RDWR | O_CLOEXEC));
            if (node.fd.get() >= 0) {
                node.descriptors = read_descriptors(node.fd.get());
            } else {
                node.error = errno;
                const FileDescriptor readable(::open(node.path.c_str(), O_RDONLY | O_CLOEXEC));
                if (readable.get() >= 0)
                    node.descriptors = read_descriptors(readable.get());
            }
            if (node.descriptors.size() >= 18)
                nodes.push_back(std::move(node));
        }
    globfree(&found);
    return nodes;
}

std::optional<UsbDevice> UsbDevice::open_node(Node &node, const std::string &serial) {
    UsbDevice device;
    device.name_ = "the camera " + node.text();
    libusb_set_option(nullptr, LIBUSB_OPTION_NO_DEVICE_DISCOVERY); // applies to all later contexts
    libusb_context *context = nullptr;
    if (const int error = libusb_init(&context))
        device.fail("starting libusb", error);
    device.context_.reset(context);
    device.fd_ = std::move(node.fd);
    libusb_device_handle *handle = nullptr;
    if (const int error = libusb_wrap_sys_device(context, device.fd_.get(), &handle))
        device.fail("opening it", error);
    device.handle_.reset(handle);
    if (!serial.empty() && string_descriptor(handle, node.serial_index()) != serial)
        return std::nullopt;
    int active = 0;
    libusb_get_configuration(handle, &active);
    device.configuration_ = find_configuration(Bytes(node.descriptors).subspan(18), active);
    libusb_set_auto_detach_kernel_driver(handle, 1);
    return device;
}

UsbDevice UsbDevice::open(const std::optional<UsbIdentity> &identity) {
    std::vector<Node> nodes = list_nodes();
    std::erase_if(nodes, [](const Node &node) { return !node.is_camera(); });
    std::string cameras;
    const Node *forbidden = nullptr;
    for (Node &node : nodes) {
        cameras += (cameras.empty() ? "" : ", ") + node.text();
        if (identity && (node.vendor() != identity->vendor || node.product() != identity->product))
            continue;
        if (node.fd.get() < 0)
            forbidden = &node;
        else if (auto device = open_node(node, identity ? identity->serial : ""))
            return std::move(*device);
    }
    if (forbidden)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "usb: the camera " + forbidden->text() + " " + forbidden->why_not_opened());
    const std::string others = cameras.empty() ? "; no USB camera is visible" : "; visible: " + cameras;
    if (!identity)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "no USB camera is connected, or the configuration does not permit it: name it with the key "
                      "'usb: {vendor: …, product: …}' of the source ('lsusb' lists both)");
    // The camera may have been unplugged and may be reconnected.
    throw Failure(ARHOST_STATUS_ERROR_DEVICE_LOST,
                  "usb: there is no camera " + id_text(identity->vendor, identity->product) +
                      (identity->serial.empty() ? "" : " with the serial number '" + identity->serial + "'") +
                      others + "; is it connected?");
}

std::vector<UsbDevice::Connected> UsbDevice::list() {
    std::vector<Connected> cameras;
    for (Node &node : list_nodes()) {
        if (!node.is_camera())
            continue;
        Connected &camera = cameras.emplace_back();
        camera.node = node.path;
        camera.id = id_text(node.vendor(), node.product());
        camera.configuration = find_configuration(Bytes(node.descriptors).subspan(18), 0);
        if (node.error != 0) {
            camera.problem = "it " + node.why_not_opened();
            continue;
        }
        try {
            camera.device = open_node(node, "");
            camera.configuration = camera.device->configuration();
            camera.product = string_descriptor(camera.device->handle(), node.product_index());
            camera.serial = string_descriptor(camera.device->handle(), node.serial_index());
        } catch (const Failure &failure) {
            camera.problem = failure.what();
        }
    }
    return cameras;
}

UsbDevice::Driver UsbDevice::driver_of(std::uint8_t interface) const {
    usbdevfs_getdriver driver{};
    driver.interface = interface;
    if (ioctl(fd_.get(), USBDEVFS_GETDRIVER, &driver) != 0)
        return Driver::none;
    return std::string_view(driver.driver) == "usbfs" ? Driver::user_space : Driver::kernel;
}

void UsbDevice::claim(std::uint8_t interface) {
    const int error = libusb_claim_interface(handle(), interface);
    if (error == LIBUSB_ERROR_BUSY)
        throw Failure(ARHOST_STATUS_ERROR_IO,
                      name_ + " is in use by another program, which does not use the kernel's driver; close it");
    if (error)
        fail("claiming interface " + std::to_string(interface), error);
}

void UsbDevice::release(std::uint8_t interface) {
    libusb_release_interface(handle(), interface);
}

void UsbDevice::set_alternate(std::uint8_t interface, std::uint8_t alternate) const {
    const int error = libusb_set_interface_alt_setting(handle(), interface, alternate);
    if (error == LIBUSB_ERROR_NO_DEVICE)
        fail_lost();
    if (error)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      name_ +
                          " gets too little bandwidth on its USB bus; choose a smaller size, a lower 'fps', 'format: "
                          "mjpeg', or another port");
}

int UsbDevice::get(std::uint8_t request, std::uint8_t selector, std::uint16_t entity,
                   std::span<std::uint8_t> data) const {
    return libusb_control_transfer(handle(), 0xa1, request, static_cast<std::uint16_t>(selector << 8), entity,
                                   data.data(), static_cast<std::uint16_t>(data.size()), request_timeout_ms);
}

int UsbDevice::set(std::uint8_t selector, std::uint16_t entity, Bytes data) const {
    std::vector<std::uint8_t> copy(data.begin(), data.end()); // libusb's argument is not const
    return libusb_control_transfer(handle(), 0x21, set_current, static_cast<std::uint16_t>(selector << 8), entity,
                                   copy.data(), static_cast<std::uint16_t>(copy.size()), request_timeout_ms);
}

void UsbDevice::fail_lost() const {
    throw Failure(ARHOST_STATUS_ERROR_DEVICE_LOST, name_ + " has disappeared; was it unplugged?");
}

void UsbDevice::fail(const std::string &what, int error) const {
    if (error == LIBUSB_ERROR_NO_DEVICE)
        fail_lost();
    throw Failure(ARHOST_STATUS_ERROR_IO,
                  name_ + " reported an error while " + what + ": " +
                      (error == LIBUSB_ERROR_PIPE ? "it rejects the request" : libusb_strerror(error)));
}

void UsbDevice::fail_configuration(const std::string &key, const std::string &what) const {
    throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, key + ": " + name_ + " " + what);
}

} // namespace arhost::uvc
