// SPDX-License-Identifier: Apache-2.0
//
// The table of all configuration keys. The parser's lists of allowed keys, the table in docs/config.md and the JSON
// Schema for editors are generated from it.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace arhost::run_config {

enum class Type { map, list, text, input_path, output_path, integer, real, boolean, reals, free_map };

constexpr std::string_view required =
    "required"; // as a default value: the key is required if its parent map is present

struct Key {
    std::string path; // "tracker.targets[].name": "[]" stands for each element of a list
    Type type;
    std::string_view default_value; // or `required`; "" if there is no default
    std::string meaning;            // description in one sentence, including the unit
    std::span<const std::string_view> choices{};
    bool is_required() const { return default_value == required; }
};

std::span<const Key> schema();

// Returns the keys of the map at `path`. "" is the root; "outputs[]" is any element of the list "outputs".
std::vector<std::string_view> keys_of(std::string_view path);
const Key &key_at(std::string_view path);

} // namespace arhost::run_config
