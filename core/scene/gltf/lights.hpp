// SPDX-License-Identifier: Apache-2.0
//
// The lights of a glTF file (KHR_lights_punctual). Private to core/scene.
#pragma once

#include "scene/gltf/json_node.hpp"

#include <arhost/scene.h>

#include <glm/mat4x4.hpp>

#include <string>
#include <vector>

namespace arhost::scene {

class GltfLights {
public:
    // `json`: of the file; it must outlive this object. `name`: of the file, for messages.
    GltfLights(const nlohmann::json &json, const std::string &name);

    // Returns the light to which a node refers. `reference`: the extension of the node; `world_from_node`: in mm;
    // `scale`: mm in a unit of the file. Radiances are those of the file: 1 lx on a white surface gives 1/π.
    arhost_light at(const JsonNode &reference, const glm::dmat4 &world_from_node, double scale) const;

private:
    std::vector<JsonNode> lights_;
};

} // namespace arhost::scene
