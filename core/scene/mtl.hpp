// SPDX-License-Identifier: Apache-2.0
//
// Wavefront MTL files, with the extension for physically based rendering (Pr, Pm, norm). Private to core/scene.
#pragma once

#include "scene/arena_builder.hpp"
#include "scene/callbacks.hpp"
#include "scene/mesh_file.hpp"

#include <glm/vec3.hpp>

#include <map>
#include <optional>
#include <string>

namespace arhost::scene {

struct MtlTexture {
    std::string file;     // relative to the folder of the MTL file
    Texture lookup;       // -s, -o, -clamp
    float multiplier = 1; // -bm
    std::string where;    // "chair.mtl:12: map_Kd", for messages
};

struct MtlMaterial {
    std::optional<glm::vec3> diffuse, specular, emission, transmission; // Kd, Ks, Ke, Tf
    std::optional<float> exponent, opacity, transparency, index, roughness, metallic,
        model; // Ns, d, Tr, Ni, Pr, Pm, illum
    std::optional<MtlTexture> diffuse_map, specular_map, emission_map, opacity_map, roughness_map, metallic_map,
        bump_map, normal_map;
};

// Returns the materials by name. Reduces values above the highest valid one to it. Logs the statements and options
// that it ignores, except Ka and map_Ka. Throws MeshError.
std::map<std::string, MtlMaterial> parse_mtl(MeshFile &file, const Reporter &reporter);

} // namespace arhost::scene
