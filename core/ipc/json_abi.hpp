// SPDX-License-Identifier: Apache-2.0
//
// Converts ABI structs to and from the JSON of control messages. Workers are not trusted, so the functions that read
// JSON validate it: they throw nlohmann::json::exception or std::runtime_error on malformed input.
#pragma once

#include "ipc/channel.hpp"
#include "ipc/memory.hpp"

#include <arhost/arhost.h>

#include <optional>
#include <string>
#include <vector>

namespace arhost::ipc {

// Copies of arhost_option_descriptor, arhost_descriptor and arhost_option that own their strings.
struct OptionDeclaration {
    std::string key;
    arhost_option_type type = 0;
    std::optional<std::string> default_value;
    double minimum = 0, maximum = 0;
    std::vector<std::string> choices;
    std::string help;
};
struct PluginDescription {
    arhost_kind kind = 0;
    std::string id, name, version, vendor, licence, description;
    std::uint32_t capabilities = 0;
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

// Returns the options of a descriptor. Steps by struct_size, because the plugin's headers may be newer and its
// structs larger.
std::vector<const arhost_option_descriptor *> options_of(const arhost_descriptor &descriptor);

PluginDescription describe(const arhost_descriptor &descriptor);

// Maximum size in bytes of each text of a descriptor, and of the whole descriptor as JSON, which must fit into a
// Hello message.
constexpr std::size_t max_text_size = 4096, max_descriptor_size = Channel::max_message_size - 1024;

Json to_json(const PluginDescription &description);
Json to_json(const arhost_descriptor &descriptor);
PluginDescription description_from_json(const Json &json);

Json to_json(const arhost_intrinsics &intrinsics);
arhost_intrinsics intrinsics_from_json(const Json &json);

// The JSON contains only the fields that a source sets; format_from_json recomputes the layout.
Json to_json(const arhost_frame_format &format);
arhost_frame_format format_from_json(const Json &json);

Json to_json(const SlotLayout &layout);
SlotLayout layout_from_json(const Json &json);

const char *to_text(arhost_kind kind);
const char *status_text(arhost_status status);

} // namespace arhost::ipc
