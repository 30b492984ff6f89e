// SPDX-License-Identifier: Apache-2.0
//
// Triangle meshes out of OBJ and PLY files, plain or compressed with gzip.
#pragma once

#include "scene/arena.hpp"
#include "scene/callbacks.hpp"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <stdexcept>

namespace arhost::scene {

// what() is one sentence for the user that begins with the file and the line, or the byte where there
// are no lines: "bunny.ply:12: a vertex needs three numbers".
class MeshError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

struct MeshOptions {
    // true: normals from the file, or computed where it has none; false: none, flat triangles; absent:
    // normals where the file has them.
    std::optional<bool> smooth;
    // Of the file, and of what it unpacks to: 40 million triangles take about 2 GiB as text.
    std::uint64_t byte_limit = std::uint64_t(4) << 30;
};

// Vertices are as in the file, texcoords those of arhost/scene.h, normals of unit length, polygons cut into
// triangles. At least one triangle.
TriangleMesh load_mesh(const std::filesystem::path &file, const MeshOptions &options = {},
                       const LoadCallbacks &callbacks = {});

// Area-weighted means of the triangles' normals. Vertices at the same place share one, so that seams of
// the texture don't show.
std::vector<glm::vec3> smooth_normals(const TriangleMesh &mesh);

} // namespace arhost::scene
