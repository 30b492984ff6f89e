// SPDX-License-Identifier: Apache-2.0
//
// glTF 2.0 files, .gltf and .glb: meshes, materials, textures, animations. Private to core/scene.
#pragma once

#include "scene/mesh.hpp"
#include "scene/shapes.hpp"
#include "scene/textures.hpp"

#include <optional>

namespace arhost::scene {

class AnimationError : public MeshError {
public:
    using MeshError::MeshError;
};

struct GltfPlacement {
    std::string name;                 // objects are called "name/node"
    Transform from_gltf;              // into the space of `node`
    std::uint32_t node = ARHOST_NONE; // that carries it, or the world
    arhost_role role = ARHOST_ROLE_VIRTUAL;
    std::optional<std::uint32_t> material; // in place of the file's
    std::optional<std::string> animation;  // name or number; none: all stands still
};

// Adds all meshes of the file's default scene. Returns how many seconds its animation takes, or 0. Throws
// MeshError, ImageError, or AnimationError where there is no such animation.
float add_gltf(ArenaBuilder &builder, Textures &textures, const std::filesystem::path &file,
               const GltfPlacement &placement, const LoadCallbacks &callbacks);

} // namespace arhost::scene
