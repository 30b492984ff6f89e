// SPDX-License-Identifier: Apache-2.0
//
// Replacement mesh for a missing mesh file. Private to core/scene.
#pragma once

#include "scene/mesh.hpp"

#include <cstdint>

namespace arhost::scene {

inline constexpr std::uint32_t stand_in_faces_minimum = 100, stand_in_faces_maximum = 20'000'000;

// A bumpy tube along a trefoil knot with exactly `faces` triangles, no normals, counter-clockwise seen from
// outside. Its bounding box is `size`, stands on y = 0 and is centred above the origin, like the meshes of
// tools/get-models. It is closed for an even number of triangles; closed meshes with an odd number do not exist,
// so one vertex is then a T-junction on its neighbour's edge.
TriangleMesh stand_in(std::uint32_t faces, const glm::dvec3 &size);

} // namespace arhost::scene
