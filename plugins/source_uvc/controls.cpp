// SPDX-License-Identifier: Apache-2.0
#include "controls.hpp"

#include "camera_common/control_options.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <iterator>

namespace arhost::uvc {
namespace {

using enum ControlKind;
constexpr auto terminal = UnitKind::camera_terminal, processing = UnitKind::processing_unit;

constexpr std::array<ControlDefinition, 26> definitions = {{
    {"auto_exposure", terminal, 1, 0x02, 1, 0, 1, false, menu},
    {"exposure_dynamic_framerate", terminal, 2, 0x03, 1, 0, 1, false, boolean},
    {"exposure_time_absolute", terminal, 3, 0x04, 4, 0, 4, false, integer},
    {"focus_absolute", terminal, 5, 0x06, 2, 0, 2, false, integer},
    {"iris_absolute", terminal, 7, 0x09, 2, 0, 2, false, integer},
    {"zoom_absolute", terminal, 9, 0x0b, 2, 0, 2, false, integer},
    {"pan_absolute", terminal, 11, 0x0d, 8, 0, 4, true, integer},
    {"tilt_absolute", terminal, 11, 0x0d, 8, 4, 4, true, integer},
    {"roll_absolute", terminal, 13, 0x0f, 2, 0, 2, true, integer},
    {"focus_automatic_continuous", terminal, 17, 0x08, 1, 0, 1, false, boolean},
    {"privacy", terminal, 18, 0x11, 1, 0, 1, false, boolean},
    {"brightness", processing, 0, 0x02, 2, 0, 2, true, integer},
    {"contrast", processing, 1, 0x03, 2, 0, 2, false, integer},
    {"hue", processing, 2, 0x06, 2, 0, 2, true, integer},
    {"saturation", processing, 3, 0x07, 2, 0, 2, false, integer},
    {"sharpness", processing, 4, 0x08, 2, 0, 2, false, integer},
    {"gamma", processing, 5, 0x09, 2, 0, 2, false, integer},
    {"white_balance_temperature", processing, 6, 0x0a, 2, 0, 2, false, integer},
    {"blue_balance", processing, 7, 0x0c, 4, 0, 2, false, integer},
    {"red_balance", processing, 7, 0x0c, 4, 2, 2, false, integer},
    {"backlight_compensation", processing, 8, 0x01, 2, 0, 2, false, integer},
    {"gain", processing, 9, 0x04, 2, 0, 2, false, integer},
    {"power_line_frequency", processing, 10, 0x05, 1, 0, 1, false, menu},
    {"hue_automatic", processing, 11, 0x10, 1, 0, 1, false, boolean},
    {"white_balance_automatic", processing, 12, 0x0b, 1, 0, 1, false, boolean},
    {"contrast_automatic", processing, 18, 0x13, 1, 0, 1, false, boolean},
}};

// The items of the kernel's menu auto_exposure, and the corresponding values of the UVC class.
struct ExposureMode {
    std::int64_t item;
    std::uint8_t value; // also the item's bit in the set of supported modes
    const char *name;
};
constexpr std::array<ExposureMode, 4> exposure_modes = {
    {{0, 2, "auto_mode"}, {1, 1, "manual_mode"}, {2, 4, "shutter_priority_mode"}, {3, 8, "aperture_priority_mode"}}};

bool is_exposure_mode(const ControlDefinition &control) {
    return control.kind == menu && control.unit == terminal;
}

std::int64_t decode(const ControlDefinition &control, Bytes data) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < control.width; ++i)
        value |= std::uint64_t{data[control.offset + i]} << (8 * i);
    const unsigned unused_bits = 64 - 8u * std::clamp<unsigned>(control.width, 1, 8);
    return control.is_signed ? static_cast<std::int64_t>(value << unused_bits) >> unused_bits
                             : static_cast<std::int64_t>(value);
}

std::int64_t item_of(const ControlDefinition &control, std::int64_t value) {
    if (is_exposure_mode(control))
        for (const ExposureMode &mode : exposure_modes)
            if (mode.value == value)
                return mode.item;
    return value;
}

std::string hex_text(Bytes bytes) {
    std::string text;
    for (const std::uint8_t byte : bytes) {
        char hex[3];
        std::snprintf(hex, sizeof hex, "%02x", byte);
        text += hex;
    }
    return text;
}

template <class T> std::optional<T> number(std::string_view text, int base) {
    T value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
    return error == std::errc() && end == text.data() + text.size() && !text.empty() ? std::optional(value)
                                                                                     : std::nullopt;
}

// Returns an empty vector if the text does not consist of pairs of hexadecimal digits.
std::vector<std::uint8_t> parse_hex(std::string_view text) {
    std::vector<std::uint8_t> bytes;
    for (std::size_t i = 0; i < text.size(); i += 2) {
        const auto byte = text.size() - i < 2 ? std::nullopt : number<std::uint8_t>(text.substr(i, 2), 16);
        if (!byte)
            return {};
        bytes.push_back(*byte);
    }
    return bytes;
}

} // namespace

Controls::Controls(const UsbDevice &device, const VideoFunction &function) : device_(device), function_(function) {}

std::uint16_t Controls::entity_of(const Unit &unit) const {
    return static_cast<std::uint16_t>(unit.id << 8 | function_.control_interface);
}

const Unit *Controls::unit_of(const ControlDefinition &control) const {
    const auto found = std::ranges::find_if(function_.units, [&](const Unit &unit) {
        return unit.kind == control.unit && (unit.controls >> control.bit & 1);
    });
    return found == function_.units.end() ? nullptr : &*found;
}

const ControlDefinition *Controls::find(std::string_view name) const {
    const auto found = std::ranges::find(definitions, name, &ControlDefinition::name);
    return found != definitions.end() && unit_of(*found) ? &*found : nullptr;
}

std::vector<ControlDefinition> Controls::all() const {
    std::vector<ControlDefinition> found;
    std::ranges::copy_if(definitions, std::back_inserter(found),
                         [&](const auto &control) { return unit_of(control); });
    return found;
}

std::vector<std::uint8_t> Controls::read(std::uint8_t request, const ControlDefinition &control) const {
    std::vector<std::uint8_t> data(control.size);
    const int got = device_.get(request, control.selector, entity_of(*unit_of(control)), data);
    if (got == LIBUSB_ERROR_NO_DEVICE)
        device_.fail("reading '" + std::string(control.name) + "'", got);
    if (got != control.size)
        data.clear();
    return data;
}

ControlValues Controls::values_of(const ControlDefinition &control) const {
    ControlValues values{control.kind, 0, 1, 0, 1, {}};
    if (control.kind == boolean)
        return values;
    const auto bound = [&](std::uint8_t request, std::int64_t otherwise) {
        const std::vector<std::uint8_t> data = read(request, control);
        return data.empty() ? otherwise : decode(control, data);
    };
    if (is_exposure_mode(control)) {
        const std::int64_t supported = bound(get_resolution, 0x0f);
        for (const ExposureMode &mode : exposure_modes)
            if (supported & mode.value)
                values.items[mode.item] = mode.name;
        values.maximum = 3;
    } else if (control.kind == menu) { // power_line_frequency
        values.items = {{0, "disabled"}, {1, "50_hz"}, {2, "60_hz"}};
        values.maximum = bound(get_maximum, 2);
        if (values.maximum >= 3)
            values.items[3] = "auto";
    } else {
        const std::int64_t all = std::int64_t{1} << (8 * control.width);
        values.minimum = bound(get_minimum, control.is_signed ? -all / 2 : 0);
        values.maximum = bound(get_maximum, control.is_signed ? all / 2 - 1 : all - 1);
        values.step = static_cast<std::uint64_t>(std::max<std::int64_t>(bound(get_resolution, 1), 1));
        values.default_value = bound(get_default, values.minimum);
    }
    return values;
}

std::optional<std::int64_t> Controls::value_of(const ControlDefinition &control) const {
    const std::vector<std::uint8_t> data = read(get_current, control);
    return data.empty() ? std::nullopt : std::optional(item_of(control, decode(control, data)));
}

std::string Controls::set(const ControlDefinition &control, std::string_view text, const std::string &key) const {
    const std::string name(control.name);
    const std::int64_t value = accepted_value(*this, control, text, key);
    std::int64_t encoded = value;
    if (is_exposure_mode(control))
        for (const ExposureMode &mode : exposure_modes)
            if (mode.item == value)
                encoded = mode.value;
    // The data may contain other values, which must not change.
    std::vector<std::uint8_t> data = read(get_current, control);
    data.resize(control.size);
    for (std::size_t i = 0; i < control.width; ++i)
        data[control.offset + i] = static_cast<std::uint8_t>(encoded >> (8 * i));
    const int sent = device_.set(control.selector, entity_of(*unit_of(control)), data);
    if (sent == LIBUSB_ERROR_PIPE) {
        constexpr unsigned can_set = 2, disabled = 4; // flags of the answer to GET_INFO
        std::array<std::uint8_t, 1> info{};
        const bool is_known =
            device_.get(get_info, control.selector, entity_of(*unit_of(control)), info) == 1 && info[0] != 0;
        if (is_known && (info[0] & disabled))
            device_.fail_configuration(key, "controls '" + name + "' automatically; disable its automatic mode");
        if (is_known && !(info[0] & can_set))
            device_.fail_configuration(key, "does not let programs set '" + name + "'");
    }
    if (sent < 0)
        device_.fail("setting '" + name + "' to " + std::string(text), sent);
    const std::int64_t now = value_of(control).value_or(value);
    if (now == value)
        return "";
    return "the camera has set '" + name + "' to " + std::to_string(now) + " instead of " + std::to_string(value);
}

std::vector<std::string> Controls::set_extensions(std::string_view list, const std::string &key) const {
    std::vector<std::string> warnings;
    for (const ControlSetting &setting : split_settings(list))
        if (const std::string warning = set_extension(setting, key); !warning.empty())
            warnings.push_back(warning);
    return warnings;
}

std::string Controls::set_extension(const ControlSetting &setting, const std::string &key) const {
    const std::size_t colon = setting.name.find(':');
    const std::string unit_name = setting.name.substr(0, colon);
    const std::string selector_text = colon == std::string::npos ? "" : setting.name.substr(colon + 1);
    const std::uint8_t selector = number<std::uint8_t>(selector_text, 10).value_or(0);
    const std::vector<std::uint8_t> data = parse_hex(setting.value.value_or(""));
    if (selector == 0 || data.empty())
        device_.fail_configuration(key, "cannot be set up: '" + setting.text +
                                            "' is not of the form UNIT:SELECTOR=BYTES, such as 4:9=01ff");
    std::string units;
    const Unit *unit = nullptr;
    for (const Unit &candidate : function_.units) {
        if (candidate.kind != UnitKind::extension_unit)
            continue;
        const std::string id = std::to_string(candidate.id), guid = to_text(candidate.guid);
        units += (units.empty() ? "" : ", ") + id + " (" + guid + ")";
        if (unit_name == id || unit_name == guid)
            unit = &candidate;
    }
    if (!unit)
        device_.fail_configuration(key, "has no extension unit '" + unit_name + "'" +
                                            (units.empty() ? "" : "; it has: " + units));
    const std::string what = "extension unit " + unit_name + ", selector " + std::to_string(selector);
    std::array<std::uint8_t, 2> length{};
    if (const int got = device_.get(get_length, selector, entity_of(*unit), length); got != 2)
        device_.fail("reading the length of " + what, got < 0 ? got : LIBUSB_ERROR_IO);
    if (const std::size_t expected = length[0] | length[1] << 8; expected != data.size())
        device_.fail_configuration(key, "expects " + std::to_string(expected) + " bytes for " + what + ", not " +
                                            std::to_string(data.size()));
    if (const int sent = device_.set(selector, entity_of(*unit), data); sent < 0)
        device_.fail("setting " + what, sent);
    std::vector<std::uint8_t> found(data.size());
    // Some extension units cannot be read back.
    const int got = device_.get(get_current, selector, entity_of(*unit), found);
    if (got != static_cast<int>(data.size()) || found == data)
        return "";
    return "the camera has set " + what + " to " + hex_text(found) + " instead of " + hex_text(data);
}

} // namespace arhost::uvc
