// SPDX-License-Identifier: Apache-2.0
//
// What the plugin's speed is compared with: the same primary rays through the same trace(), and nothing else. Into the
// image goes how far away the hit is, infinity where there is none.

void write_distance(uvec2 at) {
    at.y += band.first_row;
    if (at.x >= frame.width || at.y >= frame.height)
        return;
    uint pixel = at.y * frame.width + at.x;
    vec3 direction;
    float way = INFINITY;
    if (direction_of(pixel, vec2(0.0), direction))
        way = trace(Ray(frame.eye, direction, INFINITY, OPAQUE_MASK | GLASS_MASK | OCCLUDER_MASK), false, false).way;
    image_pixels[pixel] = floatBitsToUint(way);
}
