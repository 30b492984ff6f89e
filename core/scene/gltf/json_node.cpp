// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/json_node.hpp"

#include "scene/gltf/file.hpp"
#include "scene/mesh.hpp"

#include <algorithm>
#include <cstdio>
#include <limits>

namespace arhost::scene {

void JsonNode::fail(const std::string &message) const {
    throw MeshError(file_ + ": " + printable(path_) + ": " + message);
}

std::optional<JsonNode> JsonNode::find(const char *key) const {
    if (!value_->is_object())
        fail("must be an object");
    const auto found = value_->find(key);
    if (found == value_->end())
        return std::nullopt;
    return JsonNode(*found, path_.empty() ? key : path_ + "." + key, file_);
}

JsonNode JsonNode::at(const char *key) const {
    const auto node = find(key);
    if (!node)
        fail("needs '" + std::string(key) + "'");
    return *node;
}

std::vector<JsonNode> JsonNode::items() const {
    if (!value_->is_array())
        fail("must be an array");
    std::vector<JsonNode> items;
    for (const nlohmann::json &item : *value_)
        items.emplace_back(item, path_ + "[" + std::to_string(items.size()) + "]", file_);
    return items;
}

std::vector<JsonNode> JsonNode::items(const char *key) const {
    const auto node = find(key);
    return node ? node->items() : std::vector<JsonNode>();
}

std::vector<std::pair<std::string, JsonNode>> JsonNode::members() const {
    if (!value_->is_object())
        fail("must be an object");
    std::vector<std::pair<std::string, JsonNode>> members;
    for (const auto &[key, value] : value_->items())
        members.emplace_back(key, JsonNode(value, path_ + "." + key, file_));
    return members;
}

std::optional<JsonNode> JsonNode::extension(const char *name) const {
    const auto extensions = find("extensions");
    return extensions ? extensions->find(name) : std::nullopt;
}

float JsonNode::number(float low, float high) const {
    constexpr double tolerance = 1e-3;
    const double value = value_->is_number() ? value_->get<double>() : std::numeric_limits<double>::quiet_NaN();
    if (!(value >= low - tolerance && value <= high + tolerance)) {
        char range[80];
        std::snprintf(range, sizeof range, "must be a number from %.4g to %.4g", low, high);
        fail(range);
    }
    return std::clamp(static_cast<float>(value), low, high);
}

bool JsonNode::boolean() const {
    if (!value_->is_boolean())
        fail("must be true or false");
    return value_->get<bool>();
}

int JsonNode::index() const {
    if (!value_->is_number_unsigned() || value_->get<std::uint64_t>() > std::numeric_limits<int>::max())
        fail("must be an index, 0 or greater");
    return value_->get<int>();
}

std::uint32_t JsonNode::integer(std::uint32_t low, std::uint32_t high) const {
    const std::uint64_t value = value_->is_number_unsigned() ? value_->get<std::uint64_t>() : ~std::uint64_t(0);
    if (value < low || value > high)
        fail("must be a whole number from " + std::to_string(low) + " to " + std::to_string(high));
    return static_cast<std::uint32_t>(value);
}

std::string JsonNode::text() const {
    if (!value_->is_string())
        fail("must be a string");
    return value_->get<std::string>();
}

float JsonNode::number_or(const char *key, float fallback, float low, float high) const {
    const auto node = find(key);
    return node ? node->number(low, high) : fallback;
}

std::uint32_t JsonNode::integer_or(const char *key, std::uint32_t fallback, std::uint32_t low,
                                   std::uint32_t high) const {
    const auto node = find(key);
    return node ? node->integer(low, high) : fallback;
}

bool JsonNode::boolean_or(const char *key, bool fallback) const {
    const auto node = find(key);
    return node ? node->boolean() : fallback;
}

std::string JsonNode::text_or(const char *key, const std::string &fallback) const {
    const auto node = find(key);
    return node ? node->text() : fallback;
}

} // namespace arhost::scene
