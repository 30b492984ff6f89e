// SPDX-License-Identifier: Apache-2.0
//
// Like query.comp, with the path integrator: renders a pixel with ray queries in a compute shader.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_ray_query : require
#include "arhost/shading/glsl.h"

#include "scene.glsl"
#include "random.glsl"
#include "path_random.glsl"
#include "texture.glsl"
#include "hits.glsl"
#include "trace_query.glsl"
#include "surface.glsl"
#include "lights.glsl"
#include "scatter.glsl"
#include "path_materials.glsl"
#include "path_lights.glsl"
#include "path_catcher.glsl"
#include "photons.glsl"
#include "pixel.glsl"
#include "layers.glsl"
#include "guides.glsl"
#include "path.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
    write_pixel(gl_GlobalInvocationID.xy);
}
