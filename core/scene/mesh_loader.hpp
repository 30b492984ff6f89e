// SPDX-License-Identifier: Apache-2.0
//
// Loads triangle meshes from OBJ and PLY files, plain or gzip-compressed.
#pragma once

#include "scene/callbacks.hpp"
#include "scene/mesh.hpp"

#include <cstdint>
#include <filesystem>
#include <optional>

namespace arhost::scene {

struct MeshOptions {
    // true: normals from the file, computed if it has none; false: no normals, flat shading; absent: normals
    // if the file has them.
    std::optional<bool> smooth;
    // Of the file, and of its uncompressed content: 40 million triangles are about 2 GiB of text.
    std::uint64_t byte_limit = std::uint64_t(4) << 30;
};

// At least one triangle; vertices as in the file, texcoords as arhost/scene.h defines them, unit normals,
// polygons triangulated. Throws MeshError.
TriangleMesh load_mesh(const std::filesystem::path &file, const MeshOptions &options = {},
                       const LoadCallbacks &callbacks = {});

} // namespace arhost::scene
