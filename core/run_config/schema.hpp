// SPDX-License-Identifier: Apache-2.0
//
// Every key of a configuration, once: what the parser allows, what docs/config.md lists and what the
// JSON Schema for editors says all come from this table.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace arhost::run_config {

enum class Type { map, list, text, input_path, output_path, integer, real, boolean, reals, free_map };

struct Key {
    std::string_view path; // "tracker.markers[].id": "[]" stands for each element of a list
    Type type;
    bool required;                  // where the map that holds it is there
    std::string_view default_value; // "" where there is none
    std::string_view meaning;       // one sentence, with the unit
    std::vector<std::string_view> choices{};
};

std::span<const Key> schema();

// The keys that the map at `path` may have ("" for the whole; "outputs[]" for an output).
std::vector<std::string_view> keys_of(std::string_view path);
const Key &key_at(std::string_view path);

std::string schema_as_markdown();    // the table of docs/config.md
std::string schema_as_json_schema(); // docs/arhost.schema.json

} // namespace arhost::run_config
