// SPDX-License-Identifier: Apache-2.0
#include "schema/schema_text.hpp"

#include "run_config/schema.hpp"

#include <nlohmann/json.hpp>

namespace arhost::schema {
namespace {

using namespace run_config;
using enum Type;

const char *type_name(Type type) {
    switch (type) {
    case map:
        return "map";
    case list:
        return "list";
    case text:
        return "text";
    case input_path:
        return "path (input)";
    case output_path:
        return "path (output)";
    case integer:
        return "whole number";
    case real:
        return "number";
    case boolean:
        return "true or false";
    case reals:
        return "list of numbers";
    case free_map:
        return "map of options";
    }
    return "";
}

using Json = nlohmann::ordered_json;

Json json_schema_of_map(std::string_view path);

Json json_schema_of(const Key &key) {
    Json json;
    switch (key.type) {
    case map:
        json = json_schema_of_map(key.path);
        break;
    case free_map:
        json["type"] = "object";
        break;
    case list: {
        json["type"] = "array";
        const std::string element = key.path + "[]";
        json["items"] = keys_of(element).empty() ? Json{{"type", "string"}} : json_schema_of_map(element);
        break;
    }
    case reals:
        json = {{"type", "array"}, {"items", {{"type", "number"}}}};
        break;
    case integer:
        json["type"] = "integer";
        break;
    case real:
        json["type"] = "number";
        break;
    case boolean:
        json["type"] = "boolean";
        break;
    default:
        json["type"] = "string";
    }
    if (!key.choices.empty())
        json["enum"] = key.choices;
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
        if (key.required)
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
        const std::string standard = key.required                ? "**required**"
                                     : key.default_value.empty() ? "—"
                                                                 : std::string(key.default_value);
        text += "| `" + key.path + "` | " + type_name(key.type) + " | " + standard + " | " + key.meaning + " |\n";
    }
    return text;
}

std::string as_json_schema() {
    Json json = {{"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", "arhost configuration"}};
    json.update(json_schema_of_map(""));
    return json.dump(2) + "\n";
}

} // namespace arhost::schema
