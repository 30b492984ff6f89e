// SPDX-License-Identifier: Apache-2.0
//
// Polygon triangulation. Private to core/scene.
#pragma once

#include <glm/vec3.hpp>

#include <cstdint>
#include <span>
#include <vector>

namespace arhost::scene {

// Concave polygons with more corners are rejected: ear clipping takes at least quadratic time.
inline constexpr std::size_t concave_corner_limit = 1000;

// Triangles as indices into `polygon`, with its winding: a fan for a convex polygon, ear clipping (Meisters
// 1975) for a concave one. Empty if it is concave with more than concave_corner_limit corners. `polygon` holds
// at least 3 indices into `positions`; the result is stored in `triangles`.
std::span<const glm::uvec3> triangulate(std::span<const std::uint32_t> polygon, std::span<const glm::vec3> positions,
                                        std::vector<glm::uvec3> &triangles);

} // namespace arhost::scene
