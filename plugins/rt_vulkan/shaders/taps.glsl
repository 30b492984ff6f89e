// SPDX-License-Identifier: Apache-2.0
//
// Edges, for the denoiser. A pixel at an edge has eight rays. Four bits for each tell which light it gets: that of one
// of the nine pixels around (3 · (dy + 1) + dx + 1), or none. Equivalent to rt_embree's find_taps() in kernel/denoiser_input.inl.

const uint TAP_COUNT = 8u, OWN_TAP = 4u, NO_TAP = 15u, ONLY_OWN = 0x44444444u;

// Returns the surface that a pixel shows, without what it mirrors.
uint shown_surface(ivec2 position) {
    if (any(lessThan(position, ivec2(0))) || any(greaterThanEqual(position, ivec2(frame.width, frame.height))))
        return 0u;
    return image_pixels[layer_word(SURFACE_PLANE, uint(position.y) * frame.width + uint(position.x))] &
           (MIRRORED_UNIT - 1u);
}
vec3 shown(uint plane, ivec2 position) {
    return read_layer(plane, uint(position.y) * frame.width + uint(position.x));
}

// Returns whether a pixel differs from a neighbour.
bool is_edge(ivec2 pixel) {
    uint surface = shown_surface(pixel);
    vec3 position = shown(POSITION_PLANE, pixel), normal = shown(NORMAL_PLANE, pixel);
    float tolerance = length(position - frame.eye) * 3.0 * frame.pixel_angle;
    const ivec2 beside[4] = ivec2[](ivec2(-1, 0), ivec2(1, 0), ivec2(0, -1), ivec2(0, 1));
    for (int i = 0; i < 4; ++i) {
        ivec2 there = pixel + beside[i];
        if (any(lessThan(there, ivec2(0))) || any(greaterThanEqual(there, ivec2(frame.width, frame.height))))
            continue;
        if (shown_surface(there) != surface)
            return true;
        if (surface != 0u && kind_of(surface) != SPECULAR_SURFACE &&
            (dot(shown(NORMAL_PLANE, there), normal) < 0.8 ||
             abs(dot(shown(POSITION_PLANE, there) - position, normal)) > tolerance))
            return true; // folded
    }
    return false;
}

// Returns which light a ray through an edge pixel gets.
uint tap_of(ivec2 pixel, vec3 direction) {
    Ray ray = Ray(frame.eye, direction, INFINITY, OPAQUE_MASK | GLASS_MASK | OCCLUDER_MASK | OF_EYE);
    Hit hit;
    // Catchers do not hide the virtual objects behind them.
    for (;;) {
        bool of_catchers = ray.mask == CATCHER_MASK;
        hit = trace(ray, false, of_catchers);
        if (of_catchers || !has_catchers || (hit.object != NONE && objects[hit.object].role == VIRTUAL))
            break;
        ray.t_max = hit.object != NONE ? hit.t : INFINITY;
        ray.mask = CATCHER_MASK;
    }
    if (hit.object == NONE || objects[hit.object].role == OCCLUDER)
        return NO_TAP;
    uint surface = surface_of(hit), chosen = OWN_TAP;
    vec3 position = frame.eye + direction * hit.t;
    float least = 1e30;
    for (uint tap = 0u; tap < 9u; ++tap) {
        ivec2 there = pixel + ivec2(tap % 3u, tap / 3u) - 1;
        if (shown_surface(there) != surface)
            continue;
        float apart = tap == OWN_TAP ? 0.0 : 0.05 * frame.pixel_angle * hit.t;
        if (kind_of(surface) != SPECULAR_SURFACE)
            apart += abs(dot(shown(NORMAL_PLANE, there), shown(POSITION_PLANE, there) - position));
        if (apart < least) {
            least = apart;
            chosen = tap;
        }
    }
    return chosen;
}

void write_taps(uvec2 position) {
    position.y += band.first_row;
    if (position.x >= frame.width || position.y >= frame.height)
        return;
    uint pixel = position.y * frame.width + position.x, taps = ONLY_OWN;
    if (is_edge(ivec2(position))) {
        // A lattice with a different row and column for each ray.
        const uint columns[TAP_COUNT] = uint[](3u, 6u, 1u, 4u, 7u, 2u, 5u, 0u);
        taps = 0u;
        for (uint i = 0u; i < TAP_COUNT; ++i) {
            vec3 direction;
            bool has_ray = direction_of(pixel, (vec2(columns[i], i) + 0.5) / float(TAP_COUNT) - 0.5, direction);
            taps |= (has_ray ? tap_of(ivec2(position), direction) : NO_TAP) << (4u * i);
        }
    }
    image_pixels[layer_word(TAPS_PLANE, pixel)] = taps;
}
