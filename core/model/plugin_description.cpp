// SPDX-License-Identifier: Apache-2.0
#include "model/plugin_description.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace arhost::model {
namespace {

std::string text_or_empty(const char *text) {
    return text ? text : "";
}

// Whether an id has three or more parts, as in "org.arhost.rt_embree".
bool is_unique_id(const std::string &id) {
    constexpr const char *characters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.";
    const bool has_empty_part =
        id.empty() || id.front() == '.' || id.back() == '.' || id.find("..") != std::string::npos;
    return !has_empty_part && id.find_first_not_of(characters) == std::string::npos &&
           std::ranges::count(id, '.') >= 2;
}

} // namespace

std::string problem_with_id(const std::string &id, const std::filesystem::path &file) {
    if (!is_unique_id(id))
        return "its id is '" + id + "'; it must begin with a domain in reverse order, as in 'org.example." +
               (id.empty() ? "tracker" : id) + "'";
    const std::string name = short_name(id);
    if (file.stem() != name && file.stem() != "lib" + name) // some build tools prepend "lib" to the file name
        return "its id is '" + id + "'; rename the file to match";
    return "";
}

std::vector<const arhost_option_descriptor *> options_of(const arhost_descriptor &descriptor) {
    std::vector<const arhost_option_descriptor *> all;
    for (std::size_t i = 0; i < descriptor.option_count; ++i)
        all.push_back(reinterpret_cast<const arhost_option_descriptor *>(
            reinterpret_cast<const std::byte *>(descriptor.options) + i * descriptor.options->struct_size));
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

void check(const PluginDescription &d) {
    const auto check_text = [](const char *key, const std::string &text) {
        if (text.size() > max_text_size)
            throw std::runtime_error(std::string("the descriptor's '") + key + "' has " +
                                     std::to_string(text.size()) + " bytes; the maximum is " +
                                     std::to_string(max_text_size));
    };
    if (d.kind < ARHOST_KIND_SOURCE || d.kind > ARHOST_KIND_SINK)
        throw std::runtime_error("the descriptor's kind is " + std::to_string(d.kind) + ", which is invalid");
    check_text("id", d.id);
    check_text("name", d.name);
    check_text("version", d.version);
    check_text("vendor", d.vendor);
    check_text("licence", d.licence);
    check_text("description", d.description);
    for (const OptionDeclaration &option : d.options) {
        check_text("key", option.key);
        if (option.type < ARHOST_OPTION_BOOL || option.type > ARHOST_OPTION_LISTEN)
            throw std::runtime_error("the option '" + option.key + "' has an invalid type");
        check_text("default", option.default_value.value_or(""));
        for (const auto &[key, value] : {std::pair{"minimum", option.minimum}, {"maximum", option.maximum}})
            if (!std::isfinite(value))
                throw std::runtime_error(std::string("'") + key + "' is not finite");
        check_text("help", option.help);
    }
}

bool are_valid(const Counters &counters) {
    constexpr std::string_view characters = "abcdefghijklmnopqrstuvwxyz0123456789_";
    return counters.size() <= ARHOST_MAX_COUNTERS && std::ranges::all_of(counters, [&](const auto &counter) {
               const std::string &name = counter.first;
               return !name.empty() && name.size() <= ARHOST_MAX_COUNTER_NAME &&
                      name.find_first_not_of(characters) == std::string::npos;
           });
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

} // namespace arhost::model
