// SPDX-License-Identifier: Apache-2.0
//
// What is drawn for a mesh whose file isn't there. Private to core/scene.
#pragma once

#include "scene/arena.hpp"

namespace arhost::scene {

inline constexpr std::uint32_t stand_in_faces_minimum = 100, stand_in_faces_maximum = 20'000'000;

// A trefoil knot of a bumpy tube with exactly so many triangles, without normals, wound counter-clockwise seen
// from outside. It fills the box `size` that stands on y = 0, its middle above the origin, as the meshes of
// tools/get-models do. It is closed, but for an odd number of triangles, which no closed mesh has: one vertex
// then lies on the middle of its neighbour's edge.
TriangleMesh stand_in(std::uint32_t faces, const glm::dvec3 &size);

} // namespace arhost::scene
