// SPDX-License-Identifier: Apache-2.0
#include "camera_common/control_values.hpp"

#include <algorithm>
#include <charconv>

namespace arhost {
namespace {

std::string_view trimmed(std::string_view text) {
    const auto begin = text.find_first_not_of(' '), end = text.find_last_not_of(' ');
    return begin == std::string_view::npos ? std::string_view() : text.substr(begin, end - begin + 1);
}

std::optional<std::int64_t> number(std::string_view text) {
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc() && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

} // namespace

std::string describe_values(const ControlValues &values) {
    if (values.kind == ControlKind::boolean)
        return "true or false";
    std::string text;
    for (const auto &[value, item] : values.items)
        text += (text.empty() ? "" : ", ") + std::to_string(value) + " (" + item + ")";
    if (!text.empty())
        return text;
    text = std::to_string(values.minimum) + " to " + std::to_string(values.maximum);
    return values.step > 1 ? text + " in steps of " + std::to_string(values.step) : text;
}

std::optional<std::int64_t> parse_value(const ControlValues &values, std::string_view text) {
    if (values.kind == ControlKind::button)
        return 0;
    if (values.kind == ControlKind::boolean && (text == "true" || text == "false"))
        return text == "true";
    for (const auto &[value, item] : values.items)
        if (item == text)
            return value;
    const std::optional<std::int64_t> value = number(text);
    const bool is_valid =
        value && *value >= values.minimum && *value <= values.maximum &&
        (values.kind == ControlKind::menu
             ? values.items.contains(*value)
             : values.step <= 1 || static_cast<std::uint64_t>(*value - values.minimum) % values.step == 0);
    return is_valid ? value : std::nullopt;
}

std::vector<ControlSetting> split_settings(std::string_view list) {
    std::vector<ControlSetting> settings;
    while (!trimmed(list).empty()) {
        const std::size_t comma = std::min(list.find(','), list.size());
        const std::string_view entry = trimmed(list.substr(0, comma));
        list.remove_prefix(std::min(comma + 1, list.size()));
        const std::size_t equals = entry.find('=');
        ControlSetting setting{std::string(trimmed(entry.substr(0, equals))), std::string(entry), std::nullopt};
        if (equals != std::string_view::npos)
            setting.value = trimmed(entry.substr(equals + 1));
        settings.push_back(std::move(setting));
    }
    return settings;
}

} // namespace arhost
