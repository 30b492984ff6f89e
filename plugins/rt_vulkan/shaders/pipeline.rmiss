// SPDX-License-Identifier: Apache-2.0
//
// A ray that hits nothing: of one from the eye, alpha is 0.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_ray_tracing : require
#include "payload.glsl"

layout(location = 0) rayPayloadInEXT Found met;

void main() {
    met.object = FOUND_NOTHING;
}
