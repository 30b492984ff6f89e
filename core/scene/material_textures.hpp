// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arhost/scene.h>

#include <array>
#include <cstdint>

namespace arhost::scene {

// Returns the textures of a material; ARHOST_NONE for those that it does not have.
inline std::array<std::uint32_t, 16> textures_of(const arhost_material &material) {
    return {material.colour_texture,           material.metallic_roughness_texture,
            material.normal_texture,           material.emission_texture,
            material.occlusion_texture,        material.specular_texture,
            material.specular_colour_texture,  material.transmission_texture,
            material.clearcoat_texture,        material.clearcoat_roughness_texture,
            material.clearcoat_normal_texture, material.sheen_texture,
            material.sheen_roughness_texture,  material.anisotropy_texture,
            material.iridescence_texture,      material.iridescence_thickness_texture};
}

} // namespace arhost::scene
