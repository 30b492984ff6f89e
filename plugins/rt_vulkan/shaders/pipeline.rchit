// SPDX-License-Identifier: Apache-2.0
//
// The closest-hit shader. Writes the hit to the payload.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_ray_tracing : require
#include "payload.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;
hitAttributeEXT vec2 uv;

void main() {
    payload = Payload(gl_HitTEXT, uv, uint(gl_InstanceCustomIndexEXT), uint(gl_PrimitiveID), 0u);
}
