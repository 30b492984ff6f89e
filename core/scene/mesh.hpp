// SPDX-License-Identifier: Apache-2.0
//
// Triangle meshes: the data type that all readers produce, and its normals.
#pragma once

#include <glm/gtc/type_precision.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace arhost::scene {

struct TriangleMesh {
    std::vector<glm::vec3> positions;
    std::vector<glm::vec3> normals;   // one per vertex, unit length; empty: flat shading
    std::vector<glm::vec2> texcoords; // of set 0, one per vertex; then of set 1, …; or empty
    std::vector<glm::uvec3> triangles;
    std::vector<glm::u16vec4> colours{}; // linear RGB and opacity, one per vertex, or empty
    std::vector<glm::vec4> tangents{};   // one per vertex, as in arhost_geometry, or empty
    // Empty unless the mesh deforms. The layout is that of arhost_geometry.
    std::vector<glm::u16vec4> joints{};
    std::vector<glm::vec4> weights{};
    std::vector<glm::vec3> morph_positions{}, morph_normals{};
};

// Converts a channel of a colour, 0 to 1, to one of TriangleMesh::colours. NaN becomes 0.
inline std::uint16_t colour_channel(double value) {
    return static_cast<std::uint16_t>(std::lround(value > 0 ? std::min(value, 1.0) * 65535 : 0));
}

// The materials that an OBJ file names.
struct MaterialUses {
    struct Name {
        std::string text;
        std::size_t line; // of the first use
    };
    struct Run {
        std::size_t first_triangle;
        std::size_t name; // index in `names`
    };
    std::vector<std::string> libraries; // the values of `mtllib`
    std::vector<Name> names;
    std::vector<Run> runs; // by increasing triangle; triangles before the first one have no material
};

struct MeshWithMaterials {
    TriangleMesh mesh;
    MaterialUses uses;
};

// what() is one sentence for the user. It starts with the file name and, if known, the line (in binary files: the
// byte offset): "bunny.ply:12: a vertex needs three numbers".
class MeshError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

// Returns one normal per vertex: the area-weighted mean of the normals of its triangles. Vertices at the same
// position get the same normal, so texture seams do not show in the shading.
std::vector<glm::vec3> smooth_normals(const TriangleMesh &mesh);

// Returns whether each edge joins two triangles of the same orientation, and the mesh is not inside out: its back
// faces are then visible only from inside. Vertices at the same position are one.
bool is_closed(const TriangleMesh &mesh);

// Joins vertices at the same position. The mesh must have only positions and triangles.
void weld(TriangleMesh &mesh);

// Splits a mesh that does not deform into `count` parts, some of which may be empty. `parts` has the index of the
// part of each triangle.
std::vector<TriangleMesh> split(const TriangleMesh &mesh, const std::vector<std::size_t> &parts, std::size_t count);

// Applies `smooth` as described at MeshOptions::smooth, normalizes all normals, and computes those that are missing
// or have length 0.
void complete_normals(TriangleMesh &mesh, std::optional<bool> smooth);

} // namespace arhost::scene
