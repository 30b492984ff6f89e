// SPDX-License-Identifier: Apache-2.0
//
// The baseline of the speed comparison: only traces the plugin's primary rays with the same trace(). Writes the hit
// distance to the image; infinity for a miss.

void write_distance(uvec2 position) {
    position.y += band.first_row;
    if (position.x >= frame.width || position.y >= frame.height)
        return;
    uint pixel = position.y * frame.width + position.x;
    vec3 direction;
    float t = INFINITY;
    if (direction_of(pixel, vec2(0.0), direction))
        t = trace(Ray(frame.eye, direction, INFINITY, OPAQUE_MASK | GLASS_MASK | OCCLUDER_MASK), false, false).t;
    image_pixels[pixel] = floatBitsToUint(t);
}
