// SPDX-License-Identifier: Apache-2.0
//
// Finds the taps of a pixel with software BVH traversal, on any Vulkan 1.1 device.
#version 450
#extension GL_GOOGLE_include_directive : require
#include "arhost/shading/glsl.h"

#include "scene.glsl"
#include "texture.glsl"
#include "hits.glsl"
#include "trace_plain.glsl"
#include "pixel.glsl"
#include "layers.glsl"
#include "taps.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
    write_taps(gl_GlobalInvocationID.xy);
}
