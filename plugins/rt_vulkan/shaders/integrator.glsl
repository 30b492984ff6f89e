// SPDX-License-Identifier: Apache-2.0
//
// From a pixel to its colour and alpha, as rt_embree's kernel/kernel.inl has it. One loop and one trace() in it for
// rays of every stage, so that the code stays small.

const int PRIMARY_STAGE = 1, CATCHER_STAGE = 2, PATH_STAGE = 3;

// What a virtual object behind a catcher looks like does not depend on the catcher; an occluder in front of anything
// hides it. Linear light, and alpha.
vec4 traced(vec3 direction, Random random) {
    vec3 light = vec3(0.0);
    float alpha = 0.0;
    waiting_count = 0;
    int stage = PRIMARY_STAGE;
    Path path = Path(frame.eye, direction, vec3(1.0), 0u);
    Ray ray = Ray(frame.eye, direction, INFINITY, OPAQUE_MASK | GLASS_MASK | OCCLUDER_MASK);
    for (;;) {
        Hit hit = trace(ray, false, stage == CATCHER_STAGE);
        bool is_hit = hit.object != NONE;
        if (stage == PRIMARY_STAGE) {
            if (is_hit && objects[hit.object].role == VIRTUAL) {
                alpha = 1.0;
            } else {
                if (!has_catchers)
                    break;
                ray.end = is_hit ? hit.way : INFINITY;
                ray.mask = CATCHER_MASK;
                stage = CATCHER_STAGE;
                continue;
            }
        } else if (stage == PATH_STAGE && !is_hit) {
            light += path.throughput * environment_light(ray.direction);
        }
        if (is_hit) {
            Surface s = surface_at(ray, hit, true);
            vec3 ahead = normalize(ray.direction);
            uint material = objects[hit.object].material, model = materials[material].model;
            bool catches = stage == CATCHER_STAGE, is_lit = model != MIRROR && model != GLASS;
            Random own = Random(random.pixel ^ (path.depth << 12), random.seed, random.number);
            if (is_lit && !catches)
                shaded(s, hit);
            if (is_lit || catches) {
                Gathered sum = gathered(s, -ahead, catches, own);
                if (catches)
                    return caught_shadow(sum);
                light += path.throughput * sum.light;
            }
            light += scatter(path, s, ahead, material, own);
        }
        if (waiting_count == 0)
            break;
        path = waiting[--waiting_count];
        ray = Ray(path.origin, path.direction, INFINITY, ALL_MASKS);
        stage = PATH_STAGE;
    }
    return vec4(light, alpha);
}

// A pixel's direction in the camera's axes, or one of its slopes.
vec3 stored_ray(uint first, float z) {
    return vec3(rays[first], rays[first + 1u], ray_dimensions == 3u ? rays[first + 2u] : z);
}

// False where the lens sees nothing.
bool direction_of(uint pixel, vec2 within, out vec3 direction) {
    uint first = pixel * ray_dimensions * (has_slopes ? 3u : 1u);
    direction = stored_ray(first, 1.0);
    bool sees = abs(direction.x) < 1e29;
    if (has_slopes)
        direction += stored_ray(first + ray_dimensions, 0.0) * within.x +
                     stored_ray(first + 2u * ray_dimensions, 0.0) * within.y;
    mat3 m = frame.world_from_camera;
    precise vec3 in_world = m[0] * direction.x + m[1] * direction.y + m[2] * direction.z; // see ordered_dot()
    direction = in_world;
    return sees;
}

uint srgb8(float linear) {
    // As arhost/shading/srgb8.hpp: the code that the exact formula rounds to.
    int bits = floatBitsToInt(clamp(linear, 1.0 / 8192.0, 1.0));
    uint number = min(uint((bits - (114 << 23)) >> 16), FIRST_LIGHT_OF_CODE - 1u); // of NaN, too
    int cell = int(tables[FIRST_SRGB_CELL + number]);
    return uint((cell >> 17) + ((bits & 0xffff) >= (cell & 0x1ffff) ? 1 : 0));
}

uint packed(uvec4 codes) {
    return codes.x | (codes.y << 8) | (codes.z << 16) | (codes.w << 24);
}

uint code_of(float value) {
    return uint(code_8bit(value));
}

// One sample as it is, or the mean of all so far.
uint pixel_of(uvec2 at) {
    uint pixel = at.y * frame.width + at.x;
    vec4 sum = vec4(0.0), value = vec4(0.0);
    bool averages = frame.sample_count != 1u || frame.accumulates != 0u;
    for (uint i = 0u; i < frame.sample_count; ++i) {
        vec3 direction;
        value = vec4(0.0);
        if (direction_of(pixel, frame.samples[i].xy, direction))
            value = traced(direction, random_of_pixel(at, frame.first_sample + i));
        // What the composite will mix: premultiplied, encoded.
        if (averages)
            sum += vec4(vec3(srgb_encode(value.x), srgb_encode(value.y), srgb_encode(value.z)) * value.a, value.a);
    }
    if (!averages)
        return packed(uvec4(srgb8(value.x), srgb8(value.y), srgb8(value.z), code_of(value.a)));
    if (frame.accumulates != 0u) {
        if (frame.first_sample > 0u)
            sum += history[pixel];
        history[pixel] = sum;
    }
    // Premultiplied means, then straight: the sums' common divisor cancels out.
    float share = 1.0 / max(sum.a, 1e-6);
    float count = float(frame.first_sample + frame.sample_count);
    return packed(
        uvec4(code_of(sum.x * share), code_of(sum.y * share), code_of(sum.z * share), code_of(sum.a * (1.0 / count))));
}

void write_pixel(uvec2 at) {
    at.y += band.first_row;
    if (at.x >= frame.width || at.y >= frame.height)
        return;
    uint pixel = pixel_of(at);
    image_pixels[at.y * frame.width + at.x] = pixel;
    if (pixel >> 24 == 0u)
        return;
    // Few pixels widen what is drawn already; an old value that is read here costs a step that changes nothing.
    ivec2 place = ivec2(at);
    if (place.x < drawn_x0)
        atomicMin(drawn_x0, place.x);
    if (place.y < drawn_y0)
        atomicMin(drawn_y0, place.y);
    if (place.x >= drawn_x1)
        atomicMax(drawn_x1, place.x + 1);
    if (place.y >= drawn_y1)
        atomicMax(drawn_y1, place.y + 1);
}
