// SPDX-License-Identifier: Apache-2.0
//
// Wavefront OBJ files: v, vn, vt and f. Ignores vertex colours, groups, smoothing groups, materials, points,
// lines and curves.
#pragma once

#include "scene/callbacks.hpp"
#include "scene/mesh.hpp"
#include "scene/mesh_file.hpp"

namespace arhost::scene {

// Does not flip texcoords: v = 0 is the bottom of the texture. Throws MeshError.
TriangleMesh parse_obj(MeshFile &file, const Reporter &reporter);

} // namespace arhost::scene
