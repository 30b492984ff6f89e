// SPDX-License-Identifier: Apache-2.0
//
// The bare trace (bare.glsl) on the path "plain".
#version 450
#extension GL_GOOGLE_include_directive : require
#include "arhost/shading/glsl.h"

#include "scene.glsl"
#include "random.glsl"
#include "texture.glsl"
#include "hits.glsl"
#include "trace_plain.glsl"
#include "surface.glsl"
#include "lights.glsl"
#include "scatter.glsl"
#include "pixel.glsl"
#include "integrator.glsl"
#include "bare.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
    write_distance(gl_GlobalInvocationID.xy);
}
