// SPDX-License-Identifier: Apache-2.0
#include "cameras.hpp"

#include "controls.hpp"
#include "usb.hpp"

#include <algorithm>

namespace arhost::uvc {
namespace {

DeviceSize size_of(const FrameSize &frame) {
    DeviceSize size{frame.width, frame.height, {}, false};
    const auto add = [&](std::uint32_t interval) {
        if (interval > 0)
            size.rates.push_back(static_cast<double>(intervals_per_second) / interval);
    };
    std::ranges::for_each(frame.intervals, add);
    if (frame.intervals.empty()) {
        add(frame.shortest_interval);
        if (frame.longest_interval != frame.shortest_interval)
            add(frame.longest_interval);
        size.is_rate_range = size.rates.size() == 2;
    }
    return size;
}

std::vector<DeviceFormat> formats_of(const VideoFunction &function) {
    std::vector<DeviceFormat> formats;
    for (const auto &[encoding, name] : encodings)
        for (const StreamingInterface &stream : function.streams)
            for (const Format &format : stream.formats)
                if (format.encoding == encoding) {
                    DeviceFormat &listed = formats.emplace_back(DeviceFormat{name, {}, false});
                    for (const FrameSize &frame : format.frames)
                        listed.sizes.push_back(size_of(frame));
                }
    return formats;
}

std::vector<DeviceControl> controls_of(const UsbDevice &device, const VideoFunction &function) {
    std::vector<DeviceControl> listed;
    const Controls controls(device, function);
    for (const ControlDefinition &control : controls.all()) {
        const ControlValues values = controls.values_of(control);
        const arhost_device_control_type type = control.kind == ControlKind::boolean ? ARHOST_DEVICE_CONTROL_BOOLEAN
                                                : control.kind == ControlKind::menu  ? ARHOST_DEVICE_CONTROL_MENU
                                                                                     : ARHOST_DEVICE_CONTROL_INTEGER;
        if (values.minimum <= values.maximum) // some cameras report an invalid range
            listed.push_back({std::string(control.name), type, values.minimum, values.maximum,
                              static_cast<std::int64_t>(values.step), values.default_value,
                              controls.value_of(control)});
    }
    return listed;
}

void describe(UsbDevice::Connected &camera, const VideoFunction &function, Device &device) {
    device.formats = formats_of(function);
    if (!camera.device) {
        device.state = ARHOST_DEVICE_STATE_UNUSABLE;
        device.problem = camera.problem;
        return;
    }
    const UsbDevice::Driver driver = camera.device->driver_of(function.control_interface);
    if (driver == UsbDevice::Driver::user_space) {
        device.state = ARHOST_DEVICE_STATE_BUSY;
    } else if (device.formats.empty()) {
        device.state = ARHOST_DEVICE_STATE_UNUSABLE;
        device.problem = "it offers no supported format";
    }
    if (driver != UsbDevice::Driver::none)
        return; // requests about controls require the interface, which a driver holds
    camera.device->claim(function.control_interface);
    device.controls = controls_of(*camera.device, function);
    camera.device->release(function.control_interface);
}

} // namespace

std::vector<Device> list_cameras() {
    std::vector<Device> devices;
    for (UsbDevice::Connected &camera : UsbDevice::list()) {
        const std::vector<VideoFunction> &functions = camera.configuration.functions;
        for (std::size_t i = 0; i < functions.size(); ++i) {
            Device device{.index = static_cast<std::uint32_t>(devices.size()),
                          .kind = ARHOST_DEVICE_CAMERA,
                          .is_default = devices.empty(),
                          .name = camera.product.empty() ? "USB camera" : camera.product,
                          .path = camera.node,
                          .serial = camera.serial};
            device.name += " (usb " + camera.id + (functions.size() > 1 ? ", camera " + std::to_string(i) : "") + ")";
            try {
                describe(camera, functions[i], device);
            } catch (const Failure &failure) {
                device.state = ARHOST_DEVICE_STATE_UNUSABLE;
                device.problem = failure.what();
            }
            devices.push_back(std::move(device));
        }
    }
    return devices;
}

} // namespace arhost::uvc
