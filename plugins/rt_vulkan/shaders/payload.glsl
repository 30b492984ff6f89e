// SPDX-License-Identifier: Apache-2.0
//
// What the pipeline path's shaders tell the one that has sent the ray.

struct Found {
    float way;
    vec2 at;     // of a triangle: the shares of its second and third corner
    uint object; // NONE: nothing
    uint number; // of the triangle or sphere, in its geometry
};

const uint FOUND_NOTHING = 0xffffffffu;
