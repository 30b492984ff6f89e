// SPDX-License-Identifier: Apache-2.0
#include "schema/schema_text.hpp"

#include "run_config/schema.hpp"

#include <nlohmann/json.hpp>

namespace arhost::schema {
namespace {

using namespace run_config;
using enum Type;

// The name of each Type in the documentation and in JSON Schema.
struct TypeName {
    const char *documented, *json;
};
constexpr TypeName type_names[] = {{"map", "object"},
                                   {"list", "array"},
                                   {"text", "string"},
                                   {"path (input)", "string"},
                                   {"path (output)", "string"},
                                   {"whole number", "integer"},
                                   {"number", "number"},
                                   {"true or false", "boolean"},
                                   {"list of numbers", "array"},
                                   {"map of options", "object"}};

const TypeName &name_of(Type type) {
    return type_names[static_cast<std::size_t>(type)];
}

using Json = nlohmann::ordered_json;

Json json_schema_of_map(std::string_view path);

Json json_schema_of(const Key &key) {
    Json json = key.type == map ? json_schema_of_map(key.path) : Json{{"type", name_of(key.type).json}};
    if (key.type == list) {
        const std::string element = key.path + "[]";
        json["items"] = keys_of(element).empty() ? Json{{"type", "string"}} : json_schema_of_map(element);
    }
    if (key.type == reals)
        json["items"] = {{"type", "number"}};
    if (!key.choices.empty())
        json["enum"] = std::vector<std::string_view>(key.choices.begin(), key.choices.end());
    if (key.path == "version")
        json["const"] = 1;
    if (key.path == "tracker.targets[].ids")
        json["type"] = {"string", "integer", "array"};
    json["description"] = key.meaning;
    return json;
}

Json json_schema_of_map(std::string_view path) {
    Json json = {{"type", "object"}, {"additionalProperties", false}};
    Json required = Json::array();
    for (const std::string_view name : keys_of(path)) {
        const Key &key = key_at(path.empty() ? std::string(name) : std::string(path) + "." + std::string(name));
        json["properties"][std::string(name)] = json_schema_of(key);
        if (key.is_required())
            required.push_back(name);
    }
    if (!required.empty())
        json["required"] = required;
    return json;
}

} // namespace

std::string as_markdown() {
    std::string text = "| key | type | default | meaning |\n| --- | --- | --- | --- |\n";
    for (const Key &key : run_config::schema()) {
        const std::string standard = key.is_required()           ? "**required**"
                                     : key.default_value.empty() ? "—"
                                                                 : std::string(key.default_value);
        text += "| `" + key.path + "` | " + name_of(key.type).documented + " | " + standard + " | " + key.meaning +
                " |\n";
    }
    return text;
}

std::string as_json_schema() {
    Json json = {{"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", "arhost configuration"}};
    json.update(json_schema_of_map(""));
    return json.dump(2) + "\n";
}

} // namespace arhost::schema
