// SPDX-License-Identifier: Apache-2.0
//
// Polygon triangulation. Private to core/scene.
#pragma once

#include <glm/vec3.hpp>

#include <cstdint>
#include <span>
#include <vector>

namespace arhost::scene {

// Concave polygons with more corners are rejected, because ear clipping takes at least quadratic time.
inline constexpr std::size_t concave_corner_limit = 1000;

// Triangulates `polygon`, which has at least 3 indices into `positions`. Returns triangles as indices into `polygon`,
// with the same winding; their memory is `triangles`. Makes a fan from a convex polygon and clips the ears of a
// concave one (Meisters 1975). Returns nothing if the polygon is concave and has more than concave_corner_limit
// corners.
std::span<const glm::uvec3> triangulate(std::span<const std::uint32_t> polygon, std::span<const glm::vec3> positions,
                                        std::vector<glm::uvec3> &triangles);

} // namespace arhost::scene
