// SPDX-License-Identifier: Apache-2.0
//
// The ray payload of the pipeline path.

struct Payload {
    float t;
    vec2 uv;     // of a triangle: the barycentric coordinates of its second and third corner
    uint object; // MISS: no hit
    uint number; // of the triangle or sphere in its geometry
};

const uint MISS = 0xffffffffu;
