// SPDX-License-Identifier: Apache-2.0
//
// arhost/shading/scalar.hpp: compiles the functions of leaf/*.h for scalars.
//
// A leaf file is written in the common subset of C++ and GLSL, without branches or an include guard, so that scalars
// (here), SIMD packets (plugins/raytracer_common/packets/packet.hpp) and shaders (glsl.h) share the formulas. It must
// be included in a namespace that defines
//   ARHOST_LEAF            function prefix: "inline", or nothing in GLSL
//   Float, Bool, Vec3      a number, the result of a comparison, three numbers; for one SIMD lane or many
//   vec3(x, y, z), select(b, yes, no) of Float and of Vec3
//   abs, min, max, floor, pow, exp2, sqrt of Float; dot, cross, length, normalize of Vec3
//   cosine_of_turn(t), sine_of_turn(t)   cosine and sine of an angle of t full turns
//   turn_of(x, y)                        the angle of (x, y) from the y axis towards the x axis in turns, −½ to ½
// Include a leaf file after the leaf files whose functions it calls.
#pragma once

#include "vec3.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace arhost::shading {

using Float = double;
using Bool = bool;
using Vec3 = Vec3T<Float>;
constexpr Float select(Bool condition, Float yes, Float no) {
    return condition ? yes : no;
}
using std::abs;
using std::exp2;
using std::floor;
using std::max;
using std::min;
using std::pow;
using std::sqrt;
constexpr Vec3 vec3(Float x, Float y, Float z) {
    return {x, y, z};
}
constexpr Vec3 select(Bool condition, Vec3 yes, Vec3 no) {
    return condition ? yes : no;
}
inline Float length(Vec3 a) {
    return sqrt(dot(a, a));
}
inline Vec3 normalize(Vec3 a) {
    return a * (1 / length(a));
}
inline Float cosine_of_turn(Float t) {
    return std::cos(2 * std::numbers::pi * t);
}
inline Float sine_of_turn(Float t) {
    return std::sin(2 * std::numbers::pi * t);
}
inline Float turn_of(Float x, Float y) {
    return std::atan2(x, y) / (2 * std::numbers::pi);
}

#define ARHOST_LEAF inline
#include "leaf/colour.h"

#include "leaf/alpha.h"
#include "leaf/bsdf.h"
#include "leaf/environment.h"
#include "leaf/film.h"
#include "leaf/lens.h"
#include "leaf/light.h"
#include "leaf/sampling.h"
#include "leaf/sheen.h"
#include "leaf/surface.h"
#undef ARHOST_LEAF

} // namespace arhost::shading
