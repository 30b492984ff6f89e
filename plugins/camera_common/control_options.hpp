// SPDX-License-Identifier: Apache-2.0
//
// The options of a source that set the controls of its camera, at the start and during the run. `Controls` below is
// the plugin's class for the controls of its API. It must have these functions, which throw Failure if they fail:
//   all()                         returns the controls; each has a `name`
//   find(handle)                  returns the control with this handle or with this name, or nullptr
//   values_of(control)            returns the ControlValues that the control accepts
//   set(control, text, key)       sets the control; returns a warning if the camera sets another value, else ""
//   fail(key, what)               throws "KEY: the camera … WHAT"
#pragma once

#include "camera_common/control_values.hpp"

#include <arhost-cpp/plugin.hpp>

#include <algorithm>
#include <array>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace arhost {

// A control that has an automatic mode. `Handle`: how the API identifies a control.
template <class Handle> struct AutomaticControl {
    std::string_view key; // the option that sets this control
    Handle value, mode;   // mode: the control that enables or disables the automatic mode
};

inline constexpr arhost_option_descriptor exposure_option =
    option(ARHOST_OPTION_TEXT, "exposure", "", "Exposure time in units of 100 µs, or auto; not set: unchanged.");
inline constexpr arhost_option_descriptor gain_option =
    option(ARHOST_OPTION_TEXT, "gain", "", "Gain in units of the camera, or auto if it can; not set: unchanged.");
inline constexpr arhost_option_descriptor focus_option =
    option(ARHOST_OPTION_TEXT, "focus", "", "Focus in units of the camera, or auto; not set: unchanged.");
inline constexpr arhost_option_descriptor white_balance_option =
    option(ARHOST_OPTION_TEXT, "white_balance", "", "Colour temperature in K, or auto; not set: unchanged.");
inline constexpr arhost_option_descriptor power_line_frequency_option =
    option(ARHOST_OPTION_TEXT, "power_line_frequency", "",
           "Frequency of the lamps, to avoid flicker: disabled, 50_hz, 60_hz or auto; not set: unchanged.");
inline constexpr arhost_option_descriptor controls_option =
    option(ARHOST_OPTION_TEXT, "controls", "",
           "Further controls by the names that arhost devices lists: 'sharpness=3, backlight_compensation=1'.");

// Throws a Failure which states that the camera has no control `name`. `key`: the option that names the control.
template <class Controls>
[[noreturn]] void fail_missing(const Controls &controls, std::string_view name, const std::string &key) {
    std::string names;
    for (const auto &control : controls.all())
        names += (names.empty() ? "" : ", ") + std::string(control.name);
    controls.fail(key, "has no control '" + std::string(name) + "'" + (names.empty() ? "" : "; it has: " + names));
}

// Returns the value that `text` represents. Throws Failure if the control does not accept it.
template <class Controls, class Control>
std::int64_t accepted_value(const Controls &controls, const Control &control, std::string_view text,
                            const std::string &key) {
    const ControlValues values = controls.values_of(control);
    const std::optional<std::int64_t> value = parse_value(values, text);
    if (!value)
        controls.fail(key, "does not accept '" + std::string(text) + "' for '" + std::string(control.name) +
                               "'; valid: " + describe_values(values));
    return *value;
}

// Sets a control to a number, which disables its automatic mode, or to "auto". Checks the value before setting
// anything. Returns warnings.
template <class Controls, class Handle>
std::vector<std::string> set_automatic_control(const Controls &controls, const AutomaticControl<Handle> &control,
                                               const std::string &text) {
    // The values of the mode, in order of preference. For exposure, the values are those of V4L2: 0 automatic, 1
    // manual, 2 shutter priority, 3 aperture priority.
    static constexpr std::array<std::int64_t, 2> exposure_automatic = {0, 3}, exposure_manual = {1, 2};
    static constexpr std::array<std::int64_t, 1> on = {1}, off = {0};
    const std::string key(control.key);
    const bool is_automatic = text == "auto", is_exposure = key == "exposure";
    const auto *const found = controls.find(control.value);
    if (!is_automatic) {
        if (!found)
            fail_missing(controls, key, key);
        accepted_value(controls, *found, text, key);
    }
    std::vector<std::string> warnings;
    if (const auto *mode = controls.find(control.mode)) {
        const std::span<const std::int64_t> values =
            is_automatic  ? is_exposure ? std::span<const std::int64_t>(exposure_automatic) : on
            : is_exposure ? std::span<const std::int64_t>(exposure_manual)
                          : off;
        const ControlValues accepted = controls.values_of(*mode);
        // If the camera has none of the values, the last one is used, so that set() reports the error.
        const auto value = std::find_if(values.begin(), values.end() - 1, [&](std::int64_t candidate) {
            return accepted.items.empty() || accepted.items.contains(candidate);
        });
        warnings.push_back(controls.set(*mode, std::to_string(*value), key));
    } else if (is_automatic) {
        fail_missing(controls, "auto " + key, key);
    }
    if (!is_automatic)
        warnings.push_back(controls.set(*found, text, key));
    return warnings;
}

// Sets controls from a user's list such as "gain=20, auto_exposure=manual_mode", in this order. Checks all values
// before setting any control. Returns warnings.
template <class Controls>
std::vector<std::string> set_listed_controls(const Controls &controls, std::string_view list,
                                             const std::string &key) {
    const std::vector<ControlSetting> settings = split_settings(list);
    for (const ControlSetting &setting : settings) {
        if (!setting.value || setting.name.empty())
            controls.fail(key, "cannot be set up: '" + setting.text + "' is not of the form NAME=VALUE");
        const auto *control = controls.find(std::string_view(setting.name));
        if (!control)
            fail_missing(controls, setting.name, key);
        accepted_value(controls, *control, *setting.value, key);
    }
    std::vector<std::string> warnings;
    warnings.reserve(settings.size());
    for (const ControlSetting &setting : settings)
        warnings.push_back(controls.set(*controls.find(std::string_view(setting.name)), *setting.value, key));
    return warnings;
}

inline void show_warnings(const Host &host, const std::vector<std::string> &warnings) {
    for (const std::string &warning : warnings)
        if (!warning.empty())
            host.warn(warning);
}

// Sets the controls of the options with these keys and values, and logs warnings. `lamps`: the control that the
// option power_line_frequency sets.
template <class Controls, class Handle, std::size_t count>
void set_option_controls(const Host &host, const Controls &controls,
                         const AutomaticControl<Handle> (&automatic)[count], const Handle &lamps,
                         const std::vector<std::pair<std::string, std::string>> &values) {
    const auto set = [&](const std::string &key, const std::string &text) -> std::vector<std::string> {
        if (const auto *found = std::ranges::find(automatic, key, &AutomaticControl<Handle>::key);
            found != std::end(automatic))
            return set_automatic_control(controls, *found, text);
        if (key == "controls")
            return set_listed_controls(controls, text, key);
        const auto *control = controls.find(lamps);
        if (!control)
            fail_missing(controls, key, key);
        return {controls.set(*control, text, key)};
    };
    for (const auto &[key, text] : values)
        show_warnings(host, set(key, text));
}

// Returns the key and value of each option in `options` whose value is not "". `keys`: the options to look for,
// terminated by nullptr.
inline std::vector<std::pair<std::string, std::string>> given_options(const Options &options,
                                                                      const char *const *keys) {
    std::vector<std::pair<std::string, std::string>> given;
    for (; *keys; ++keys)
        if (std::string text = options.contains(*keys) ? options.text(*keys) : ""; !text.empty())
            given.emplace_back(*keys, std::move(text));
    return given;
}

} // namespace arhost
