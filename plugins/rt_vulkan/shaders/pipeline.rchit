// SPDX-License-Identifier: Apache-2.0
//
// The nearest hit of a ray.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_ray_tracing : require
#include "payload.glsl"

layout(location = 0) rayPayloadInEXT Found met;
hitAttributeEXT vec2 at;

void main() {
    met = Found(gl_HitTEXT, at, uint(gl_InstanceCustomIndexEXT), uint(gl_PrimitiveID));
}
