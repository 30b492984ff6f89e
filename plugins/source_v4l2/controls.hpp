// SPDX-License-Identifier: Apache-2.0
//
// The controls of a V4L2 camera: gain, exposure and so on. Functions that fail throw Failure with a message for the
// user.
#pragma once

#include "capture_device.hpp"

#include "camera_common/control_values.hpp"

#include <string>
#include <vector>

namespace arhost {

struct Control : ControlValues {
    std::uint32_t id = 0, type = 0, flags = 0; // type: V4L2's
    std::string name;                          // in the form that v4l2-ctl prints: "white_balance_temperature"
};

// Returns, for example, "white_balance_automatic" for "White Balance, Automatic".
std::string control_name(std::string_view label);

class Controls {
public:
    explicit Controls(const CaptureDevice &device);

    const std::vector<Control> &all() const { return controls_; }
    const Control *find(std::uint32_t id) const;
    const Control *find(std::string_view name) const;

    static const ControlValues &values_of(const Control &control) { return control; }
    // Returns the current value, or std::nullopt if it cannot be read.
    std::optional<std::int64_t> value_of(const Control &control) const;

    // Sets a control to a value in text form: a number, "true" or "false", or the number or name of a menu item.
    // `key` names the option for messages. Returns a warning if the camera sets another value, else an empty string.
    std::string set(const Control &control, std::string_view text, const std::string &key) const;

    [[noreturn]] void fail(const std::string &key, const std::string &what) const;

private:
    const CaptureDevice &device_;
    std::vector<Control> controls_;
};

} // namespace arhost
