// SPDX-License-Identifier: Apache-2.0
//
// Values of a camera's controls, as users write them.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace arhost {

enum class ControlKind { integer, boolean, menu, button };

// The values that a control accepts.
struct ControlValues {
    ControlKind kind = ControlKind::integer;
    std::int64_t minimum = 0, maximum = 0, default_value = 0;
    std::uint64_t step = 1;
    std::map<std::int64_t, std::string> items; // number and name of each item of a menu
};

// Returns, for example, "0 to 255", "0 to 10 in steps of 5", "true or false" or "1 (manual_mode), 3
// (aperture_priority_mode)".
std::string describe_values(const ControlValues &values);

// Parses a number, "true" or "false", or the number or name of a menu item. Returns std::nullopt if the control does
// not accept the value. A button accepts any text.
std::optional<std::int64_t> parse_value(const ControlValues &values, std::string_view text);

// One entry of a list such as "gain=20, auto_exposure=manual_mode". The value is std::nullopt if there is no "=".
struct ControlSetting {
    std::string name, text; // text: the entire entry
    std::optional<std::string> value;
};
std::vector<ControlSetting> split_settings(std::string_view list);

} // namespace arhost
