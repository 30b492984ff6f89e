// SPDX-License-Identifier: Apache-2.0
//
// Replacement mesh for a missing mesh file. Private to core/scene.
#pragma once

#include "scene/mesh.hpp"

#include <cstdint>

namespace arhost::scene {

inline constexpr std::uint32_t stand_in_faces_minimum = 100, stand_in_faces_maximum = 20'000'000;

// Returns a bumpy tube along a trefoil knot. It has exactly `faces` triangles, counter-clockwise seen from outside,
// and no normals. Its bounding box has the size `size`, stands on y = 0 and is centred above the origin, like the
// meshes of tools/get-models. The mesh is closed if the number of triangles is even. No closed mesh has an odd number
// of triangles, so in that case one vertex is in the middle of an edge of the neighbouring triangle (a T-junction).
TriangleMesh stand_in(std::uint32_t faces, const glm::dvec3 &size);

} // namespace arhost::scene
