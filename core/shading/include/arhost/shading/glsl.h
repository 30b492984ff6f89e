// SPDX-License-Identifier: Apache-2.0
//
// arhost/shading/glsl.h: compiles the functions of leaf/*.h for shaders (GLSL 4.50 or newer). The shader must enable
// GL_GOOGLE_include_directive, and core/shading/include must be in the include path (glslangValidator -I…,
// glslc -I …).
#ifndef ARHOST_SHADING_GLSL_H
#define ARHOST_SHADING_GLSL_H

#define ARHOST_LEAF
#define Float float
#define Bool bool
#define Vec3 vec3

Float select(Bool condition, Float yes, Float no) {
    return mix(no, yes, condition);
}
Vec3 select(Bool condition, Vec3 yes, Vec3 no) {
    return mix(no, yes, bvec3(condition));
}
Float cosine_of_turn(Float t) {
    return cos(6.28318530717959 * t);
}
Float sine_of_turn(Float t) {
    return sin(6.28318530717959 * t);
}
Float turn_of(Float x, Float y) {
    return atan(x, x == 0.0 && y == 0.0 ? 1.0 : y) * 0.159154943091895; // atan(0, 0) is undefined in GLSL
}

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

#endif
