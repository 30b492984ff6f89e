// SPDX-License-Identifier: Apache-2.0
#include "ipc/json_abi.hpp"

#include "base/text.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

namespace arhost::ipc {
namespace {

std::string text_or_empty(const char *text) {
    return text ? text : "";
}

// Returns a string of a descriptor. Throws if it is longer than max_text_size.
std::string text_of(const Json &json, const char *key) {
    std::string text = json.at(key).get<std::string>();
    if (text.size() > max_text_size)
        throw std::runtime_error(std::string("the descriptor's '") + key + "' has " + std::to_string(text.size()) +
                                 " bytes; the maximum is " + std::to_string(max_text_size));
    return text;
}

double finite(const Json &json, const char *key) {
    const double value = json.at(key).get<double>();
    if (!std::isfinite(value))
        throw std::runtime_error(std::string("'") + key + "' is not finite");
    return value;
}

} // namespace

std::vector<const arhost_option_descriptor *> options_of(const arhost_descriptor &descriptor) {
    std::vector<const arhost_option_descriptor *> all;
    for (std::uint32_t i = 0; i < descriptor.option_count; ++i)
        all.push_back(reinterpret_cast<const arhost_option_descriptor *>(
            reinterpret_cast<const std::byte *>(descriptor.options) +
            std::size_t{i} * descriptor.options->struct_size));
    return all;
}

PluginDescription describe(const arhost_descriptor &descriptor) {
    PluginDescription d{descriptor.kind,
                        text_or_empty(descriptor.id),
                        text_or_empty(descriptor.name),
                        text_or_empty(descriptor.version),
                        text_or_empty(descriptor.vendor),
                        text_or_empty(descriptor.licence),
                        text_or_empty(descriptor.description),
                        descriptor.capabilities,
                        {},
                        {},
                        {}};
    for (const arhost_option_descriptor *o : options_of(descriptor)) {
        OptionDeclaration option{text_or_empty(o->key), o->type, {}, o->minimum, o->maximum, {},
                                 text_or_empty(o->help)};
        if (o->default_value)
            option.default_value = o->default_value;
        for (const char *const *choice = o->choices; choice && *choice; ++choice)
            option.choices.emplace_back(*choice);
        d.options.push_back(std::move(option));
    }
    for (const char *const *need = descriptor.needs; need && *need; ++need)
        d.needs.emplace_back(*need);
    return d;
}

Json to_json(const PluginDescription &d) {
    Json options = Json::array();
    for (const OptionDeclaration &o : d.options) {
        Json option = {{"key", o.key},         {"type", o.type},       {"minimum", o.minimum},
                       {"maximum", o.maximum}, {"choices", o.choices}, {"help", o.help}};
        if (o.default_value)
            option["default"] = *o.default_value;
        options.push_back(std::move(option));
    }
    return {{"kind", d.kind},
            {"id", d.id},
            {"name", d.name},
            {"version", d.version},
            {"vendor", d.vendor},
            {"licence", d.licence},
            {"description", d.description},
            {"capabilities", d.capabilities},
            {"options", std::move(options)},
            {"needs", d.needs},
            {"changeable", d.changeable}};
}

Json to_json(const arhost_descriptor &descriptor) {
    return to_json(describe(descriptor));
}

PluginDescription description_from_json(const Json &json) {
    PluginDescription d;
    d.kind = json.at("kind").get<arhost_kind>();
    if (d.kind < ARHOST_KIND_SOURCE || d.kind > ARHOST_KIND_SINK)
        throw std::runtime_error("the descriptor's kind is " + std::to_string(d.kind) + ", which is invalid");
    d.id = text_of(json, "id");
    d.name = text_of(json, "name");
    d.version = text_of(json, "version");
    d.vendor = text_of(json, "vendor");
    d.licence = text_of(json, "licence");
    d.description = text_of(json, "description");
    d.capabilities = json.at("capabilities").get<std::uint32_t>();
    for (const Json &need : json.at("needs"))
        d.needs.push_back(need.get<std::string>());
    for (const Json &key : json.at("changeable"))
        d.changeable.push_back(key.get<std::string>());
    for (const Json &o : json.at("options")) {
        OptionDeclaration option;
        option.key = text_of(o, "key");
        option.type = o.at("type").get<arhost_option_type>();
        if (option.type < ARHOST_OPTION_BOOL || option.type > ARHOST_OPTION_LISTEN)
            throw std::runtime_error("the option '" + option.key + "' has an invalid type");
        if (o.contains("default"))
            option.default_value = text_of(o, "default");
        option.minimum = finite(o, "minimum");
        option.maximum = finite(o, "maximum");
        for (const Json &choice : o.at("choices"))
            option.choices.push_back(choice.get<std::string>());
        option.help = text_of(o, "help");
        d.options.push_back(std::move(option));
    }
    return d;
}

Json to_json(const arhost_intrinsics &i) {
    return {{"width", i.width},
            {"height", i.height},
            {"fx", i.fx},
            {"fy", i.fy},
            {"cx", i.cx},
            {"cy", i.cy},
            {"distortion", i.distortion},
            {"coefficients", std::vector<double>(i.coefficients, i.coefficients + i.coefficient_count)}};
}

arhost_intrinsics intrinsics_from_json(const Json &json) {
    arhost_intrinsics i{};
    i.struct_size = sizeof i;
    i.width = json.at("width").get<std::uint32_t>();
    i.height = json.at("height").get<std::uint32_t>();
    i.fx = finite(json, "fx");
    i.fy = finite(json, "fy");
    i.cx = finite(json, "cx");
    i.cy = finite(json, "cy");
    i.distortion = json.at("distortion").get<arhost_distortion>();
    const auto coefficients = json.at("coefficients").get<std::vector<double>>();
    if (i.fx <= 0 || i.fy <= 0 || i.width < 1 || i.height < 1 || i.distortion < ARHOST_DISTORTION_NONE ||
        i.distortion > ARHOST_DISTORTION_FISHEYE || coefficients.size() > ARHOST_MAX_DISTORTION ||
        !std::all_of(coefficients.begin(), coefficients.end(), [](double k) { return std::isfinite(k); }))
        throw std::runtime_error("the camera's intrinsics are out of range");
    i.coefficient_count = static_cast<std::uint32_t>(coefficients.size());
    std::copy(coefficients.begin(), coefficients.end(), i.coefficients);
    return i;
}

Json to_json(const arhost_frame_format &f) {
    return {{"pixel_format", f.pixel_format}, {"width", f.width},         {"height", f.height},
            {"yuv_matrix", f.yuv_matrix},     {"yuv_range", f.yuv_range}, {"fps", f.fps},
            {"has_depth", f.has_depth != 0},  {"transfer", f.transfer}};
}

arhost_frame_format format_from_json(const Json &json) {
    arhost_frame_format f{};
    f.struct_size = sizeof f;
    f.pixel_format = json.at("pixel_format").get<arhost_pixel_format>();
    f.width = json.at("width").get<std::uint32_t>();
    f.height = json.at("height").get<std::uint32_t>();
    f.yuv_matrix = json.at("yuv_matrix").get<arhost_yuv_matrix>();
    f.yuv_range = json.at("yuv_range").get<arhost_yuv_range>();
    f.fps = finite(json, "fps");
    f.has_depth = json.at("has_depth").get<bool>();
    f.transfer = json.at("transfer").get<arhost_transfer>();
    const bool yuv = f.pixel_format >= ARHOST_PIXEL_FORMAT_YUYV;
    if (f.fps < 0 || f.fps > 100'000 || f.transfer < ARHOST_TRANSFER_SRGB || f.transfer > ARHOST_TRANSFER_LINEAR ||
        (yuv && (f.yuv_matrix < ARHOST_YUV_MATRIX_BT601 || f.yuv_matrix > ARHOST_YUV_MATRIX_BT709 ||
                 f.yuv_range < ARHOST_YUV_RANGE_LIMITED || f.yuv_range > ARHOST_YUV_RANGE_FULL)) ||
        !arhost_frame_layout(&f))
        throw std::runtime_error("the frame format is invalid: pixel format " + std::to_string(f.pixel_format) +
                                 ", " + std::to_string(f.width) + "x" + std::to_string(f.height) + " px, " +
                                 std::to_string(f.fps) + " fps");
    return f;
}

Json to_json(const SlotLayout &layout) {
    return {{"slot_size", layout.slot_size}, {"count", layout.count}};
}

SlotLayout layout_from_json(const Json &json) {
    return {json.at("slot_size").get<std::uint64_t>(), json.at("count").get<std::uint32_t>()};
}

const char *to_text(arhost_kind kind) {
    switch (kind) {
    case ARHOST_KIND_SOURCE:
        return "source";
    case ARHOST_KIND_TRACKER:
        return "tracker";
    case ARHOST_KIND_RAYTRACER:
        return "raytracer";
    case ARHOST_KIND_SINK:
        return "sink";
    default:
        return "unknown kind";
    }
}

const char *status_text(arhost_status status) {
    switch (status) {
    case ARHOST_STATUS_OK:
        return "ok";
    case ARHOST_STATUS_END:
        return "end";
    case ARHOST_STATUS_END_TRUNCATED:
        return "end, input truncated";
    case ARHOST_STATUS_ERROR_INVALID_ARGUMENT:
        return "invalid argument";
    case ARHOST_STATUS_ERROR_CONFIGURATION:
        return "configuration error";
    case ARHOST_STATUS_ERROR_UNSUPPORTED:
        return "not supported";
    case ARHOST_STATUS_ERROR_IO:
        return "input/output error";
    case ARHOST_STATUS_ERROR_OUT_OF_MEMORY:
        return "out of memory";
    case ARHOST_STATUS_ERROR_DEVICE_LOST:
        return "device lost";
    case ARHOST_STATUS_ERROR_CANCELLED:
        return "cancelled";
    case ARHOST_STATUS_ERROR_INTERNAL:
        return "internal error";
    default:
        return "status out of range";
    }
}

} // namespace arhost::ipc
