// SPDX-License-Identifier: Apache-2.0
//
// Polygons into triangles. Private to core/scene.
#pragma once

#include <glm/vec3.hpp>

#include <cstdint>
#include <span>
#include <vector>

namespace arhost::scene {

// A concave polygon with more corners than this isn't cut: the time grows with their square at least.
inline constexpr std::size_t concave_corner_limit = 1000;

// Triangles as places in `polygon` (0 to its size − 1), wound as it is. A convex polygon becomes a fan, a
// concave one is cut ear by ear (Meisters 1975). Empty where it is concave with too many corners.
// `polygon` holds at least 3 indices into `positions`.
std::span<const glm::uvec3> triangulate(std::span<const std::uint32_t> polygon, std::span<const glm::vec3> positions,
                                        std::vector<glm::uvec3> &triangles);

} // namespace arhost::scene
