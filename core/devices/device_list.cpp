// SPDX-License-Identifier: Apache-2.0
#include "devices/device_list.hpp"

#include "base/text.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <functional>
#include <stdexcept>

template <> struct nlohmann::adl_serializer<std::optional<std::int64_t>> {
    static void to_json(json &json, const std::optional<std::int64_t> &value) {
        json = nullptr;
        if (value)
            json = *value;
    }
    static void from_json(const json &json, std::optional<std::int64_t> &value) {
        value.reset();
        if (!json.is_null())
            value = json.get<std::int64_t>();
    }
};

namespace arhost::devices {

using Json = nlohmann::json;
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(DeviceSize, width, height, is_rate_range, rates)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(DeviceFormat, pixel_format, is_size_range, sizes)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(DeviceControl, name, type, minimum, maximum, step, default_value, value)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(DeviceDescription, index, kind, state, is_default, name, path, serial, abilities,
                                   problem, formats, controls, width, height, rate)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(DeviceList, devices, left_out)

namespace {

constexpr std::size_t longest_text = max_device_text_size + std::string_view("…").size();

[[noreturn]] void reject(const std::string &what) {
    throw std::runtime_error("it reported " + what);
}

// Returns a printable and truncated copy. Reads no further than needed, because a faulty plugin may not terminate the
// string.
std::string text_of(const char *text) {
    constexpr std::size_t longest_character = 4;
    return text ? base::printable({text, ::strnlen(text, max_device_text_size + longest_character)},
                                  max_device_text_size)
                : std::string();
}

// Returns pointers to at most `limit` elements of an array of structs, whose stride is the struct_size of the first.
template <class T>
std::vector<const T *> elements(const T *first, std::size_t count, std::size_t limit, std::size_t min_size,
                                const char *what) {
    std::vector<const T *> found;
    if (count == 0)
        return found;
    if (!first)
        reject(std::string("an array of ") + what + " that is NULL");
    if (first->struct_size < min_size)
        reject(std::string("an array of ") + what + " whose struct_size is too small");
    for (std::size_t i = 0; i < std::min(count, limit); ++i)
        found.push_back(
            reinterpret_cast<const T *>(reinterpret_cast<const std::byte *>(first) + i * first->struct_size));
    return found;
}

// The sizes of the structs in revision 2 of the extension.
constexpr std::size_t size_of_size = offsetof(arhost_device_size, rates) + sizeof(void *);
constexpr std::size_t size_of_format = offsetof(arhost_device_format, sizes) + sizeof(void *);
constexpr std::size_t size_of_control = offsetof(arhost_device_control, value) + sizeof(std::int64_t);
constexpr std::size_t size_of_device = offsetof(arhost_device, controls) + sizeof(void *);

DeviceSize describe(const arhost_device_size &size) {
    if (size.rate_count > 0 && !size.rates)
        reject("an array of rates that is NULL");
    const std::size_t count = std::min<std::size_t>(size.rate_count, ARHOST_MAX_DEVICE_RATES);
    return {size.width, size.height, size.is_rate_range != 0, {size.rates, size.rates + count}};
}

DeviceFormat describe(const arhost_device_format &format) {
    DeviceFormat copy{text_of(format.pixel_format), format.is_size_range != 0, {}};
    for (const auto *size : elements(format.sizes, format.size_count, ARHOST_MAX_DEVICE_SIZES, size_of_size, "sizes"))
        copy.sizes.push_back(describe(*size));
    return copy;
}

DeviceControl describe(const arhost_device_control &control) {
    DeviceControl copy{text_of(control.name),
                       control.type,
                       control.minimum,
                       control.maximum,
                       control.step,
                       control.default_value,
                       {}};
    if (control.has_value)
        copy.value = control.value;
    return copy;
}

void expect_at_most(std::size_t limit, std::size_t size, const char *what) {
    if (size > limit)
        reject("more than " + std::to_string(limit) + " " + what);
}

void check(const DeviceSize &size) {
    expect_at_most(ARHOST_MAX_DEVICE_RATES, size.rates.size(), "rates");
    if (size.width < 1 || size.height < 1)
        reject("a size of " + std::to_string(size.width) + "×" + std::to_string(size.height) + " px");
    if (!std::ranges::all_of(size.rates, [](double rate) { return std::isfinite(rate) && rate > 0; }))
        reject("a frame rate that is not finite and above 0");
    if (!std::ranges::is_sorted(size.rates, std::greater<>()))
        reject("frame rates that do not begin with the highest");
    if (size.is_rate_range && size.rates.size() != 2)
        reject("a range of frame rates without two ends");
}

void check(const DeviceFormat &format) {
    expect_at_most(longest_text, format.pixel_format.size(), "bytes in the name of a pixel format");
    expect_at_most(ARHOST_MAX_DEVICE_SIZES, format.sizes.size(), "sizes");
    if (format.pixel_format.empty())
        reject("a pixel format without a name");
    std::ranges::for_each(format.sizes, [](const DeviceSize &size) { check(size); });
    if (format.is_size_range && (format.sizes.size() != 2 || format.sizes[0].width > format.sizes[1].width ||
                                 format.sizes[0].height > format.sizes[1].height))
        reject("a range of sizes without a smallest and a largest size");
}

void check(const DeviceControl &control) {
    expect_at_most(longest_text, control.name.size(), "bytes in the name of a control");
    if (control.name.empty())
        reject("a control without a name");
    if (control.type < ARHOST_DEVICE_CONTROL_INTEGER || control.type > ARHOST_DEVICE_CONTROL_BUTTON)
        reject("the control '" + control.name + "' with an invalid type");
    if (control.minimum > control.maximum || control.step < 0)
        reject("the control '" + control.name + "' with an invalid range");
}

// Throws if the device violates the contract.
void check(const DeviceDescription &device) {
    for (const std::string *text : {&device.name, &device.path, &device.serial, &device.abilities, &device.problem})
        expect_at_most(longest_text, text->size(), "bytes in a text");
    expect_at_most(ARHOST_MAX_DEVICE_FORMATS, device.formats.size(), "formats");
    expect_at_most(ARHOST_MAX_DEVICE_CONTROLS, device.controls.size(), "controls");
    if (device.name.empty())
        reject("a device without a name");
    const std::string which = "the device '" + device.name + "' ";
    if (device.state < ARHOST_DEVICE_STATE_USABLE || device.state > ARHOST_DEVICE_STATE_UNUSABLE)
        reject(which + "with an invalid state");
    if ((device.state == ARHOST_DEVICE_STATE_UNUSABLE) == device.problem.empty())
        reject(which + (device.problem.empty() ? "as unusable without its problem" : "with a problem but usable"));
    const bool by_path = device.state == ARHOST_DEVICE_STATE_BUSY || device.state == ARHOST_DEVICE_STATE_FORBIDDEN;
    if (by_path && device.path.empty())
        reject(which + "as busy or forbidden without its path");
    if (device.kind != ARHOST_DEVICE_CAMERA && (!device.formats.empty() || !device.controls.empty()))
        reject(which + "with formats or controls, although it is no camera");
    if (!std::isfinite(device.rate) || device.rate < 0)
        reject(which + "with a refresh rate that is not finite and at least 0");
    std::ranges::for_each(device.formats, [](const DeviceFormat &format) { check(format); });
    std::ranges::for_each(device.controls, [](const DeviceControl &control) { check(control); });
}

void check_size(std::string_view text) {
    if (text.size() > max_device_list_size)
        reject("a list of devices that is longer than " + std::to_string(max_device_list_size) + " bytes");
}

} // namespace

DeviceDescription describe(const arhost_device *device) {
    if (!device)
        reject("a device that is NULL");
    if (device->struct_size < size_of_device)
        reject("a device whose struct_size is too small");
    DeviceDescription copy{device->index,
                           device->kind,
                           device->state,
                           device->is_default != 0,
                           text_of(device->name),
                           text_of(device->path),
                           text_of(device->serial),
                           text_of(device->abilities),
                           text_of(device->problem),
                           {},
                           {},
                           device->width,
                           device->height,
                           device->rate};
    for (const auto *format :
         elements(device->formats, device->format_count, ARHOST_MAX_DEVICE_FORMATS, size_of_format, "formats"))
        copy.formats.push_back(describe(*format));
    for (const auto *control :
         elements(device->controls, device->control_count, ARHOST_MAX_DEVICE_CONTROLS, size_of_control, "controls"))
        copy.controls.push_back(describe(*control));
    check(copy);
    return copy;
}

std::string to_text(const std::optional<DeviceList> &list) {
    std::string text = (list ? Json(*list) : Json()).dump(-1, ' ', true);
    check_size(text);
    return text;
}

std::optional<DeviceList> devices_from_text(std::string_view text) {
    check_size(text);
    const Json json = Json::parse(text);
    if (json.is_null())
        return std::nullopt;
    DeviceList list = json.get<DeviceList>();
    expect_at_most(ARHOST_MAX_DEVICES, list.devices.size(), "devices");
    std::ranges::for_each(list.devices, [](const DeviceDescription &device) { check(device); });
    return list;
}

const char *device_kind_text(arhost_device_kind kind) {
    switch (kind) {
    case ARHOST_DEVICE_DISCRETE_GPU:
        return "discrete GPU";
    case ARHOST_DEVICE_INTEGRATED_GPU:
        return "integrated GPU";
    case ARHOST_DEVICE_VIRTUAL_GPU:
        return "virtual GPU";
    case ARHOST_DEVICE_CPU:
        return "CPU";
    case ARHOST_DEVICE_CAMERA:
        return "camera";
    case ARHOST_DEVICE_DISPLAY:
        return "display";
    default:
        return "other device";
    }
}

const char *control_type_text(arhost_device_control_type type) {
    switch (type) {
    case ARHOST_DEVICE_CONTROL_BOOLEAN:
        return "boolean";
    case ARHOST_DEVICE_CONTROL_MENU:
        return "menu";
    case ARHOST_DEVICE_CONTROL_BITMASK:
        return "bitmask";
    case ARHOST_DEVICE_CONTROL_BUTTON:
        return "button";
    default:
        return "integer";
    }
}

} // namespace arhost::devices
