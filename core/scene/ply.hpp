// SPDX-License-Identifier: Apache-2.0
//
// PLY files (Turk 1994), ascii and binary in both byte orders: the elements `vertex` and `face`. Ignores all
// other elements and properties. Colours of vertices are sRGB-encoded if they are integers, and linear if they are
// floats, 0 to 1.
#pragma once

#include "scene/callbacks.hpp"
#include "scene/mesh.hpp"
#include "scene/mesh_file.hpp"

namespace arhost::scene {

// Does not flip texcoords: v = 0 is the bottom of the texture. Throws MeshError.
TriangleMesh parse_ply(MeshFile &file, const Reporter &reporter);

} // namespace arhost::scene
