// SPDX-License-Identifier: Apache-2.0
//
// The ray payload of the path `pipeline`.

struct Payload {
    float t;
    vec2 uv;     // barycentric coordinates of a triangle's second and third corner
    uint object; // MISS if there is no hit
    uint number; // index of the triangle or sphere in its geometry
    uint of_eye; // of the ray: its bit OF_EYE
};

const uint MISS = 0xffffffffu;
