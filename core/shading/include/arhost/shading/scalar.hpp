// SPDX-License-Identifier: Apache-2.0
//
// arhost/shading/scalar.hpp: the leaf functions of leaf/*.h, one value at a time.
//
// A leaf file is written in what C++ and GLSL have in common, without branches and without an include
// guard. Whoever includes it does so inside a namespace of his own that defines
//   ARHOST_LEAF            what stands before a function: "inline", or nothing in GLSL
//   Float, Bool, Vec3      a number, the result of comparing two, three numbers; one lane or many
//   select(b, yes, no), min, max, floor, pow, dot
// so that the same formulas serve scalars (here), SIMD packets (plugins/rt_embree/packet.hpp) and shaders.
#pragma once

#include "vec3.hpp"

#include <algorithm>
#include <cmath>

namespace arhost::shading {

using Float = double;
using Bool = bool;
using Vec3 = Vec3T<Float>;
constexpr Float select(Bool condition, Float yes, Float no) {
    return condition ? yes : no;
}
using std::floor;
using std::max;
using std::min;
using std::pow;

#define ARHOST_LEAF inline
#include "leaf/alpha.h"
#include "leaf/bsdf.h"
#include "leaf/colour.h"
#include "leaf/light.h"
#undef ARHOST_LEAF

} // namespace arhost::shading
