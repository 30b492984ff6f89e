// SPDX-License-Identifier: Apache-2.0
//
// glTF 2.0 files, .gltf and .glb: meshes, materials, textures, animations. Private to core/scene.
#pragma once

#include "scene/arena_builder.hpp"
#include "scene/callbacks.hpp"
#include "scene/fit.hpp"
#include "scene/mesh.hpp"
#include "scene/shapes.hpp"
#include "scene/textures.hpp"

#include <filesystem>
#include <optional>
#include <span>

namespace arhost::scene {

class AnimationError : public MeshError {
public:
    using MeshError::MeshError;
};

class VariantError : public MeshError {
public:
    using MeshError::MeshError;
};

struct GltfPlacement {
    std::string name;         // objects are named "name/node"
    Transform axes_from_gltf; // the axes of the scene, in the unit of the file
    Fit fit{};
    Transform placed{};               // of the fitted model, to the coordinates of `node`
    std::uint32_t node = ARHOST_NONE; // the parent node, or ARHOST_NONE for the world
    arhost_role role = ARHOST_ROLE_VIRTUAL;
    std::optional<std::uint32_t> material; // index of a material that replaces all materials of the file
    // Names or indices of animations, or "all"; empty: the objects do not move. Of several for one node, the last
    // counts.
    std::vector<std::string> animations{};
    bool loops = true;                    // false: the animations play once
    float speed = 1;                      // > 0
    bool has_lights = true;               // adds the lights of the file
    std::optional<std::string> variant{}; // name of a material variant; absent: the materials of the primitives
    // Files and folders, without links, from which buffers and images may be read, besides the file's own folder.
    std::span<const std::filesystem::path> reads{};
};

// Adds all meshes of the file's default scene. Returns the duration of the animation in seconds, or 0. Throws
// MeshError, ImageError, or AnimationError or VariantError if the animation or variant does not exist.
float add_gltf(ArenaBuilder &builder, Textures &textures, const std::filesystem::path &file,
               const GltfPlacement &placement, const LoadCallbacks &callbacks);

} // namespace arhost::scene
