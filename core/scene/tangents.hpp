// SPDX-License-Identifier: Apache-2.0
//
// Tangents for normal maps and anisotropic materials. Private to core/scene.
#pragma once

#include "scene/mesh.hpp"

namespace arhost::scene {

// Sets TriangleMesh::tangents from texture coordinates (set `texcoord_set`, which the mesh must have) and normals, as
// MikkTSpace defines them for tools that bake normal maps (M. Mikkelsen, Simulation of Wrinkled Surfaces Revisited,
// 2008): the mean of the directions of the triangles at a vertex, weighted by their angles. Vertices at which
// mirrored and other triangles meet are split. Does nothing to meshes that have tangents or no normals.
void add_tangents(TriangleMesh &mesh, std::size_t texcoord_set);

} // namespace arhost::scene
