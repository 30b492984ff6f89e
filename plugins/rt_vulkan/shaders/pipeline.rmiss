// SPDX-License-Identifier: Apache-2.0
//
// The miss shader. Sets the payload to MISS.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_ray_tracing : require
#include "payload.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.object = MISS;
}
