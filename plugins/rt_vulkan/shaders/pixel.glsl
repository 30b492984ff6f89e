// SPDX-License-Identifier: Apache-2.0
//
// The parts of a pixel's computation that all integrators share: the direction of its ray, 8-bit codes, and the bounding
// rectangle of the drawn pixels.

// Reads a ray direction in camera axes, or one of its derivatives, from `rays`. `z`: the z component if only x and y
// are stored.
vec3 stored_ray(uint first, float z) {
    return vec3(rays[first], rays[first + 1u], ray_dimensions == 3u ? rays[first + 2u] : z);
}

// Computes the ray direction, in world space, at the offset `within` from a pixel's centre. Returns false if the
// pixel is outside the field of view of the lens.
bool direction_of(uint pixel, vec2 within, out vec3 direction) {
    uint first = pixel * ray_dimensions * (frame.has_slopes != 0u ? 3u : 1u);
    direction = stored_ray(first, 1.0);
    bool is_visible = abs(direction.x) < 1e29;
    if (frame.has_slopes != 0u)
        direction += stored_ray(first + ray_dimensions, 0.0) * within.x +
                     stored_ray(first + 2u * ray_dimensions, 0.0) * within.y;
    mat3 m = frame.world_from_camera;
    precise vec3 in_world = m[0] * direction.x + m[1] * direction.y + m[2] * direction.z; // not m * direction: see ordered_dot()
    direction = in_world;
    return is_visible;
}

uint srgb8(float linear) {
    // Looks up the code in the table of arhost/shading/srgb8.hpp. The result equals that of the exact formula, rounded.
    int bits = floatBitsToInt(clamp(linear, 1.0 / 8192.0, 1.0));
    uint number = min(uint((bits - (114 << 23)) >> 16), FIRST_LIGHT_OF_CODE - 1u); // stays inside the table even for NaN
    int cell = int(tables[FIRST_SRGB_CELL + number]);
    return uint((cell >> 17) + ((bits & 0xffff) >= (cell & 0x1ffff) ? 1 : 0));
}

uint packed(uvec4 codes) {
    return codes.x | (codes.y << 8) | (codes.z << 16) | (codes.w << 24);
}

uint code_of(float value) {
    return uint(code_8bit(value));
}

// Extends the bounding rectangle by a drawn pixel.
void mark_drawn(uvec2 position) {
    // Most pixels do not extend the bounding rectangle and skip the atomic operations. A stale value causes at most a
    // redundant atomic operation.
    ivec2 corner = ivec2(position);
    if (corner.x < drawn_x0)
        atomicMin(drawn_x0, corner.x);
    if (corner.y < drawn_y0)
        atomicMin(drawn_y0, corner.y);
    if (corner.x >= drawn_x1)
        atomicMax(drawn_x1, corner.x + 1);
    if (corner.y >= drawn_y1)
        atomicMax(drawn_y1, corner.y + 1);
}
