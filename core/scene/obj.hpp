// SPDX-License-Identifier: Apache-2.0
//
// Wavefront OBJ files: v, vn, vt, f, mtllib and usemtl. Ignores groups, smoothing groups, points, lines and curves.
// `v` may have a colour after the coordinates: sRGB-encoded RGB and opacity, as MeshLab and Blender write it.
#pragma once

#include "scene/callbacks.hpp"
#include "scene/mesh.hpp"
#include "scene/mesh_file.hpp"

namespace arhost::scene {

// Does not flip texcoords: v = 0 is the bottom of the texture. Throws MeshError.
MeshWithMaterials parse_obj(MeshFile &file, const Reporter &reporter);

} // namespace arhost::scene
