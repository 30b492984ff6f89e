// SPDX-License-Identifier: Apache-2.0
#include "controls.hpp"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cstring>

namespace arhost {
namespace {

bool is_menu(const Control &control) {
    return control.type == V4L2_CTRL_TYPE_MENU || control.type == V4L2_CTRL_TYPE_INTEGER_MENU;
}

// Whether the control has a value that fits into 64 bits.
bool is_scalar(const v4l2_query_ext_ctrl &query) {
    switch (query.type) {
    case V4L2_CTRL_TYPE_INTEGER:
    case V4L2_CTRL_TYPE_INTEGER64:
    case V4L2_CTRL_TYPE_BOOLEAN:
    case V4L2_CTRL_TYPE_MENU:
    case V4L2_CTRL_TYPE_INTEGER_MENU:
    case V4L2_CTRL_TYPE_BITMASK:
    case V4L2_CTRL_TYPE_BUTTON:
        return query.nr_of_dims == 0;
    default:
        return false;
    }
}

std::string_view trimmed(std::string_view text) {
    const auto begin = text.find_first_not_of(' '), end = text.find_last_not_of(' ');
    return begin == std::string_view::npos ? std::string_view() : text.substr(begin, end - begin + 1);
}

std::optional<std::int64_t> number(std::string_view text) {
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc() && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

std::string describe_values(const Control &control) {
    if (control.type == V4L2_CTRL_TYPE_BOOLEAN)
        return "true or false";
    std::string text;
    for (const auto &[value, item] : control.items)
        text += (text.empty() ? "" : ", ") + std::to_string(value) + " (" + item + ")";
    if (!text.empty())
        return text;
    text = std::to_string(control.minimum) + " to " + std::to_string(control.maximum);
    return control.step > 1 ? text + " in steps of " + std::to_string(control.step) : text;
}

} // namespace

std::string control_name(std::string_view label) {
    std::string name;
    for (const unsigned char c : label)
        if (std::isalnum(c))
            name += static_cast<char>(std::tolower(c));
        else if (!name.empty() && name.back() != '_')
            name += '_';
    if (name.ends_with('_'))
        name.pop_back();
    return name;
}

Controls::Controls(const CaptureDevice &device) : device_(device) {
    v4l2_query_ext_ctrl query{};
    query.id = V4L2_CTRL_FLAG_NEXT_CTRL;
    for (; device_.control(VIDIOC_QUERY_EXT_CTRL, &query) == 0; query.id |= V4L2_CTRL_FLAG_NEXT_CTRL) {
        if ((query.flags & V4L2_CTRL_FLAG_DISABLED) || !is_scalar(query))
            continue;
        Control control{query.id,
                        query.type,
                        query.flags,
                        control_name(query.name),
                        query.minimum,
                        query.maximum,
                        query.default_value,
                        query.step,
                        {}};
        for (std::int64_t i = query.minimum; is_menu(control) && i <= std::min<std::int64_t>(query.maximum, 255);
             ++i) {
            v4l2_querymenu item{};
            item.id = query.id;
            item.index = static_cast<std::uint32_t>(i);
            if (device_.control(VIDIOC_QUERYMENU, &item) == 0)
                control.items[i] = control.type == V4L2_CTRL_TYPE_MENU
                                       ? control_name(reinterpret_cast<const char *>(item.name))
                                       : std::to_string(item.value);
        }
        controls_.push_back(std::move(control));
    }
}

const Control *Controls::find(std::uint32_t id) const {
    const auto found = std::ranges::find(controls_, id, &Control::id);
    return found == controls_.end() ? nullptr : &*found;
}

const Control *Controls::find(std::string_view name) const {
    const auto found = std::ranges::find(controls_, name, &Control::name);
    return found == controls_.end() ? nullptr : &*found;
}

void Controls::fail(const std::string &key, const std::string &what) const {
    throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                  key + ": the camera '" + device_.path() + "' (" + device_.card() + ") " + what);
}

void Controls::fail_missing(std::string_view name, const std::string &key) const {
    std::string names;
    for (const Control &control : controls_)
        names += (names.empty() ? "" : ", ") + control.name;
    fail(key, "has no control '" + std::string(name) + "'" + (names.empty() ? "" : "; it has: " + names));
}

std::int64_t Controls::parse(const Control &control, std::string_view text, const std::string &key) const {
    if (control.type == V4L2_CTRL_TYPE_BUTTON)
        return 0;
    if (control.type == V4L2_CTRL_TYPE_BOOLEAN && (text == "true" || text == "false"))
        return text == "true";
    for (const auto &[value, item] : control.items)
        if (item == text)
            return value;
    const std::optional<std::int64_t> value = number(text);
    const bool is_valid =
        value && *value >= control.minimum && *value <= control.maximum &&
        (is_menu(control)
             ? control.items.contains(*value)
             : control.step <= 1 || static_cast<std::uint64_t>(*value - control.minimum) % control.step == 0);
    if (!is_valid)
        fail(key, "does not accept '" + std::string(text) + "' for '" + control.name +
                      "'; valid: " + describe_values(control));
    return *value;
}

std::optional<std::int64_t> Controls::value_of(const Control &control) const {
    if (control.type == V4L2_CTRL_TYPE_BUTTON || (control.flags & V4L2_CTRL_FLAG_WRITE_ONLY))
        return std::nullopt;
    v4l2_ext_control found{};
    found.id = control.id;
    v4l2_ext_controls request{};
    request.which = V4L2_CTRL_WHICH_CUR_VAL;
    request.count = 1;
    request.controls = &found;
    if (device_.control(VIDIOC_G_EXT_CTRLS, &request) != 0)
        return std::nullopt;
    if (control.type == V4L2_CTRL_TYPE_INTEGER64)
        return static_cast<std::int64_t>(found.value64);
    if (control.type == V4L2_CTRL_TYPE_BITMASK)
        return static_cast<std::uint32_t>(found.value);
    return static_cast<std::int64_t>(found.value);
}

std::string Controls::set(const Control &control, std::string_view text, const std::string &key) const {
    const std::int64_t value = parse(control, text, key);
    v4l2_ext_control wanted{};
    wanted.id = control.id;
    if (control.type == V4L2_CTRL_TYPE_INTEGER64)
        wanted.value64 = value;
    else
        wanted.value = static_cast<std::int32_t>(value);
    v4l2_ext_controls request{};
    request.which = V4L2_CTRL_WHICH_CUR_VAL;
    request.count = 1;
    request.controls = &wanted;
    if (const int error = device_.control(VIDIOC_S_EXT_CTRLS, &request)) {
        if (error == EACCES || error == EPERM)
            fail(key, "does not let programs set '" + control.name + "'");
        if (error == EBUSY)
            fail(key, "controls '" + control.name +
                          "' automatically, or another program does; disable its automatic mode");
        device_.fail("setting '" + control.name + "' to " + std::string(text), error);
    }
    const std::optional<std::int64_t> set = value_of(control);
    if (!set || *set == value)
        return "";
    return "the camera has set '" + control.name + "' to " + std::to_string(*set) + " instead of " +
           std::to_string(value);
}

std::vector<std::string> Controls::set_list(std::string_view list, const std::string &key) const {
    std::vector<std::string> warnings;
    while (!trimmed(list).empty()) {
        const std::size_t comma = std::min(list.find(','), list.size());
        const std::string_view entry = trimmed(list.substr(0, comma));
        list.remove_prefix(std::min(comma + 1, list.size()));
        const std::size_t equals = entry.find('=');
        const std::string_view name = trimmed(entry.substr(0, equals));
        if (equals == std::string_view::npos || name.empty())
            fail(key, "cannot be set up: '" + std::string(entry) + "' is not of the form NAME=VALUE");
        const Control *control = find(name);
        if (!control)
            fail_missing(name, key);
        if (const std::string warning = set(*control, trimmed(entry.substr(equals + 1)), key); !warning.empty())
            warnings.push_back(warning);
    }
    return warnings;
}

} // namespace arhost
