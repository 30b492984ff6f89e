// SPDX-License-Identifier: Apache-2.0
//
// Loads triangle meshes from OBJ, PLY and STL files, plain or gzip-compressed.
#pragma once

#include "scene/callbacks.hpp"
#include "scene/mesh.hpp"

#include <cstdint>
#include <filesystem>
#include <optional>

namespace arhost::scene {

struct MeshOptions {
    // true: smooth shading, with the normals of the file, or computed ones if it has none; false: flat shading,
    // without normals; absent: smooth shading if the file has normals.
    std::optional<bool> smooth;
    // Maximum size of the file and of its decompressed content. 40 million triangles are about 2 GiB of text.
    std::uint64_t byte_limit = std::uint64_t(4) << 30;
};

// Returns a mesh with at least one triangle. Positions are those of the file, texture coordinates are as defined in
// arhost/scene.h, normals have unit length, and polygons are triangulated. Throws MeshError.
MeshWithMaterials load_mesh_with_materials(const std::filesystem::path &file, const MeshOptions &options = {},
                                           const LoadCallbacks &callbacks = {});
// Likewise, without materials; logs if the file has any.
TriangleMesh load_mesh(const std::filesystem::path &file, const MeshOptions &options = {},
                       const LoadCallbacks &callbacks = {});

} // namespace arhost::scene
