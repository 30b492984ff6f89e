// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/lights.hpp"

#include "scene/arena_builder.hpp"

#include <glm/geometric.hpp>

#include <cmath>
#include <numbers>

namespace arhost::scene {

GltfLights::GltfLights(const nlohmann::json &json, const std::string &name) {
    if (const auto extension = JsonNode(json, "", name).extension("KHR_lights_punctual"))
        if (const auto lights = extension->find("lights"))
            lights_ = lights->items();
}

arhost_light GltfLights::at(const JsonNode &reference, const glm::dmat4 &world_from_node, double scale) const {
    const JsonNode index = reference.at("light");
    const auto number = static_cast<std::size_t>(index.index());
    if (number >= lights_.size())
        index.fail("the file has only " + std::to_string(lights_.size()) + " lights");
    const JsonNode &from = lights_[number];
    const std::string type = from.text_or("type", "");
    if (type != "point" && type != "spot" && type != "directional")
        from.find("type").value_or(from).fail("must be point, spot or directional");
    arhost_light light = make_light(type == "point"  ? ARHOST_LIGHT_POINT
                                    : type == "spot" ? ARHOST_LIGHT_SPOT
                                                     : ARHOST_LIGHT_DIRECTIONAL);
    constexpr float largest_intensity = 1e9f;
    const auto colour = from.numbers_or<3>("color", {1, 1, 1}, 0, 1);
    // Candela per square metre of the file, or lux; the intensities of the arena include Lambert's 1/π.
    const double intensity = double{from.number_or("intensity", 1, 0, largest_intensity)} / std::numbers::pi *
                             (type == "directional" ? 1 : scale * scale);
    if (type != "directional")
        light.falloff = ARHOST_FALLOFF_INVERSE_SQUARE;
    const glm::dvec3 direction = -glm::normalize(glm::dvec3(world_from_node[2]));
    for (int i = 0; i < 3; ++i) {
        light.position[i] = static_cast<float>(world_from_node[3][i]);
        light.direction[i] = static_cast<float>(direction[i]);
        light.intensity[i] = static_cast<float>(double{colour[static_cast<std::size_t>(i)]} * intensity);
    }
    if (type != "spot")
        return light;
    const JsonNode spot = from.find("spot").value_or(from);
    constexpr float quarter_turn = std::numbers::pi_v<float> / 2;
    const float outer = spot.number_or("outerConeAngle", std::numbers::pi_v<float> / 4, 0, quarter_turn),
                inner = spot.number_or("innerConeAngle", 0, 0, quarter_turn);
    if (inner > outer)
        spot.find("innerConeAngle").value_or(spot).fail("must not exceed outerConeAngle");
    light.cosine_inner = std::cos(inner);
    light.cosine_outer = std::cos(outer);
    return light;
}

} // namespace arhost::scene
