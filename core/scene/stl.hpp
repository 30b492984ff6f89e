// SPDX-License-Identifier: Apache-2.0
//
// STL files (3D Systems 1989), binary and ascii, also with several solids. Ignores the normals, which many programs
// write as 0 or incorrectly: the order of the corners defines the front. Ignores attributes.
#pragma once

#include "scene/callbacks.hpp"
#include "scene/mesh.hpp"
#include "scene/mesh_file.hpp"

namespace arhost::scene {

// Joins vertices at the same position. Throws MeshError.
TriangleMesh parse_stl(MeshFile &file, const Reporter &reporter);

} // namespace arhost::scene
