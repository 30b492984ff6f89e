// SPDX-License-Identifier: Apache-2.0
//
// A value of a glTF file's JSON and its path, for messages such as "duck.gltf: materials[0].alphaCutoff: must be a
// number from 0 to 1e+09". Private to core/scene.
#pragma once

#include <nlohmann/json.hpp>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace arhost::scene {

// The functions that return a property throw MeshError if it has another type or is outside its range.
class JsonNode {
public:
    // `value` must outlive this object and its descendants.
    JsonNode(const nlohmann::json &value, std::string path, std::string file)
        : value_(&value), path_(std::move(path)), file_(std::move(file)) {}

    [[noreturn]] void fail(const std::string &message) const;

    std::optional<JsonNode> find(const char *key) const; // std::nullopt if this object has no such property
    JsonNode at(const char *key) const;                  // throws MeshError if this object has no such property
    std::vector<JsonNode> items() const;                 // of an array
    std::vector<JsonNode> items(const char *key) const;  // of an array; empty if this object has no such property
    std::vector<std::pair<std::string, JsonNode>> members() const; // of an object
    std::optional<JsonNode> extension(const char *name) const;

    // Values beyond the range by at most 1e-3, such as 1.0000001, become its nearest end.
    float number(float low, float high) const;
    bool boolean() const;
    int index() const; // into a table of the file; not negative
    std::uint32_t integer(std::uint32_t low, std::uint32_t high) const;
    std::string text() const;

    float number_or(const char *key, float fallback, float low, float high) const;
    std::uint32_t integer_or(const char *key, std::uint32_t fallback, std::uint32_t low, std::uint32_t high) const;
    bool boolean_or(const char *key, bool fallback) const;
    std::string text_or(const char *key, const std::string &fallback) const;
    template <std::size_t count>
    std::array<float, count> numbers_or(const char *key, std::array<float, count> fallback, float low,
                                        float high) const {
        const auto node = find(key);
        if (!node)
            return fallback;
        const std::vector<JsonNode> elements = node->items();
        if (elements.size() != count)
            node->fail("must have " + std::to_string(count) + " numbers");
        for (std::size_t i = 0; i < count; ++i)
            fallback[i] = elements[i].number(low, high);
        return fallback;
    }

private:
    const nlohmann::json *value_;
    std::string path_, file_;
};

} // namespace arhost::scene
