// SPDX-License-Identifier: Apache-2.0
//
// The table of all configuration keys: source of the parser's allowed keys, of the table in docs/config.md, and of
// the JSON Schema for editors.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace arhost::run_config {

enum class Type { map, list, text, input_path, output_path, integer, real, boolean, reals, free_map };

struct Key {
    std::string path; // "tracker.markers[].id": "[]" stands for each element of a list
    Type type;
    bool required;                  // if its parent map is present
    std::string_view default_value; // "": none
    std::string meaning;            // one sentence, with the unit
    std::vector<std::string_view> choices{};
};

std::span<const Key> schema();

// The keys of the map at `path`; "" is the root, "outputs[]" one output.
std::vector<std::string_view> keys_of(std::string_view path);
const Key &key_at(std::string_view path);

std::string schema_as_markdown();    // the table of docs/config.md
std::string schema_as_json_schema(); // docs/arhost.schema.json

} // namespace arhost::run_config
