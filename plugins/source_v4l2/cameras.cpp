// SPDX-License-Identifier: Apache-2.0
#include "cameras.hpp"

#include "capture_device.hpp"
#include "controls.hpp"
#include "pixels.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

namespace arhost {
namespace {

// Returns the serial number of a USB camera, or an empty string. In sysfs, the parent of the camera's USB interface
// is the USB device.
std::string serial_of(const std::string &node) {
    namespace fs = std::filesystem;
    std::error_code none;
    const fs::path interface = fs::canonical("/sys/class/video4linux" / fs::path(node).filename() / "device", none);
    std::string serial;
    if (!none && fs::exists(interface.parent_path() / "idVendor", none))
        std::getline(std::ifstream(interface.parent_path() / "serial"), serial);
    return serial;
}

std::string option_for(std::uint32_t fourcc) {
    if (fourcc == V4L2_PIX_FMT_MJPEG || fourcc == V4L2_PIX_FMT_JPEG)
        return "mjpeg";
    if (fourcc == V4L2_PIX_FMT_Z16)
        return "z16"; // for the option `depth_device`
    const RawFormat *format = find_raw_format(fourcc);
    return format ? std::string(format->name) : "";
}

std::vector<DeviceFormat> formats_of(const CaptureDevice &camera) {
    std::vector<DeviceFormat> formats;
    for (const CaptureFormat &format : camera.formats()) {
        const std::string name = option_for(format.fourcc);
        // A camera may offer variants of a format, such as NV12 in one or two planes of memory.
        if (name.empty() || std::ranges::find(formats, name, &DeviceFormat::pixel_format) != formats.end())
            continue;
        DeviceFormat &listed = formats.emplace_back(DeviceFormat{name, {}, format.any_size});
        for (const CaptureSize &size : format.sizes)
            listed.sizes.push_back({size.width, size.height, size.rates, size.any_rate});
    }
    return formats;
}

arhost_device_control_type type_of(const Control &control) {
    switch (control.type) {
    case V4L2_CTRL_TYPE_BOOLEAN:
        return ARHOST_DEVICE_CONTROL_BOOLEAN;
    case V4L2_CTRL_TYPE_MENU:
    case V4L2_CTRL_TYPE_INTEGER_MENU:
        return ARHOST_DEVICE_CONTROL_MENU;
    case V4L2_CTRL_TYPE_BITMASK:
        return ARHOST_DEVICE_CONTROL_BITMASK;
    case V4L2_CTRL_TYPE_BUTTON:
        return ARHOST_DEVICE_CONTROL_BUTTON;
    default:
        return ARHOST_DEVICE_CONTROL_INTEGER;
    }
}

std::vector<DeviceControl> controls_of(const CaptureDevice &camera) {
    std::vector<DeviceControl> listed;
    const Controls controls(camera);
    for (const Control &c : controls.all())
        if (!c.name.empty() && c.minimum <= c.maximum) // some cameras report an invalid range
            listed.push_back({c.name, type_of(c), c.minimum, c.maximum, static_cast<std::int64_t>(c.step),
                              c.default_value, controls.value_of(c)});
    return listed;
}

void describe(const CaptureDevice &camera, Device &device) {
    if (!camera.card().empty())
        device.name = camera.card();
    device.formats = formats_of(camera);
    device.controls = controls_of(camera);
    if (camera.is_busy()) {
        device.state = ARHOST_DEVICE_STATE_BUSY;
    } else if (device.formats.empty()) {
        device.state = ARHOST_DEVICE_STATE_UNUSABLE;
        device.problem = "it offers no supported format, only " + camera.describe_formats();
    }
}

} // namespace

std::vector<Device> list_cameras() {
    std::vector<Device> devices;
    for (const std::string &node : video_nodes()) {
        Device device{.index = static_cast<std::uint32_t>(devices.size()),
                      .kind = ARHOST_DEVICE_CAMERA,
                      .is_default = node == "/dev/video0",
                      .name = card_of(node),
                      .path = node,
                      .serial = serial_of(node)};
        if (device.name.empty())
            device.name = "camera";
        try {
            describe(CaptureDevice(node), device);
        } catch (const NotACamera &) {
            continue;
        } catch (const CannotOpen &failure) {
            const bool is_forbidden = failure.error == EACCES || failure.error == EPERM;
            device.state = is_forbidden             ? ARHOST_DEVICE_STATE_FORBIDDEN
                           : failure.error == EBUSY ? ARHOST_DEVICE_STATE_BUSY
                                                    : ARHOST_DEVICE_STATE_UNUSABLE;
            if (device.state == ARHOST_DEVICE_STATE_UNUSABLE)
                device.problem = std::strerror(failure.error);
        } catch (const Failure &failure) {
            device.state = ARHOST_DEVICE_STATE_UNUSABLE;
            device.problem = failure.what();
        }
        devices.push_back(std::move(device));
    }
    return devices;
}

} // namespace arhost
