// SPDX-License-Identifier: Apache-2.0
//
// A plugin's description of itself and of its options: copies of the ABI's structs that own their data.
#pragma once

#include <arhost/arhost.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace arhost::model {

// Copies of arhost_option_descriptor, arhost_descriptor and arhost_option that own their strings.
struct OptionDeclaration {
    std::string key;
    arhost_option_type type = 0;
    std::optional<std::string> default_value;
    double minimum = 0, maximum = 0;
    std::vector<std::string> choices;
    std::string help;
};
// Returns the last part of a plugin's id, by which configurations and messages name the plugin: "rt_embree".
inline std::string short_name(const std::string &id) {
    return id.substr(id.rfind('.') + 1);
}

// Returns what is wrong with the id of the plugin in `file`; "" if nothing is.
std::string problem_with_id(const std::string &id, const std::filesystem::path &file);

struct PluginDescription {
    arhost_kind kind = 0;
    std::string id, name, version, vendor, licence, description;
    std::string short_name() const { return model::short_name(id); }
    std::uint64_t capabilities = 0;
    std::vector<OptionDeclaration> options;
    std::vector<std::string> needs;      // elements of sandbox::allowances
    std::vector<std::string> changeable; // keys of the options that arhost_set_option accepts
};
struct OptionValue {
    std::string key;
    arhost_option_type type = 0;
    std::int64_t integer = 0;
    double real = 0;
    std::string text;
};

// Returns the options of a descriptor. Steps by struct_size, because a plugin that was built with newer headers has
// larger structs.
std::vector<const arhost_option_descriptor *> options_of(const arhost_descriptor &descriptor);

PluginDescription describe(const arhost_descriptor &descriptor);

// Throws std::runtime_error if a value is out of range, or a text too long.
void check(const PluginDescription &description);
constexpr std::size_t max_text_size = 4096; // bytes, of each text of a descriptor

// The events that a plugin has counted, by name (arhost/counters.h).
using Counters = std::map<std::string, std::uint64_t>;
bool are_valid(const Counters &counters); // checks the number and the names

const char *to_text(arhost_kind kind);
const char *status_text(arhost_status status);

} // namespace arhost::model
