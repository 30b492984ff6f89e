// SPDX-License-Identifier: Apache-2.0
#include "controls.hpp"

#include "camera_common/control_options.hpp"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>

namespace arhost {
namespace {

ControlKind kind_of(std::uint32_t type) {
    switch (type) {
    case V4L2_CTRL_TYPE_MENU:
    case V4L2_CTRL_TYPE_INTEGER_MENU:
        return ControlKind::menu;
    case V4L2_CTRL_TYPE_BOOLEAN:
        return ControlKind::boolean;
    case V4L2_CTRL_TYPE_BUTTON:
        return ControlKind::button;
    default:
        return ControlKind::integer;
    }
}

// Returns whether the control has a value that fits into 64 bits.
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
        Control control{{kind_of(query.type), query.minimum, query.maximum, query.default_value, query.step, {}},
                        query.id,
                        query.type,
                        query.flags,
                        control_name(query.name)};
        for (std::int64_t i = query.minimum;
             control.kind == ControlKind::menu && i <= std::min<std::int64_t>(query.maximum, 255); ++i) {
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
    const std::int64_t value = accepted_value(*this, control, text, key);
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

} // namespace arhost
