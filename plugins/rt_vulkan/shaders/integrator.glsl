// SPDX-License-Identifier: Apache-2.0
//
// Computes a pixel's colour and alpha. Equivalent to rt_embree's kernel/kernel.inl. A single loop with a single call of
// trace() handles all kinds of rays, because trace() is inlined and its code is long.

float light_samples_of(uint lamp, uint depth) {
    return float(frame.light_samples);
}

const int PRIMARY_STAGE = 1, CATCHER_STAGE = 2, PATH_STAGE = 3;

// Renders a sample and adds it to the pixel's sums. Catchers do not hide the virtual objects behind them, so primary rays
// ignore catchers. Occluders hide everything behind them.
void trace_sample(vec3 direction, Random random, inout Sums sums) {
    vec3 light = vec3(0.0);
    stack_size = 0;
    int stage = PRIMARY_STAGE;
    Path path = Path(frame.eye, direction, vec3(1.0), 0.0, 0u, OBJECT_PLANE, false);
    Ray ray = Ray(frame.eye, direction, INFINITY, OPAQUE_MASK | GLASS_MASK | OCCLUDER_MASK | OF_EYE);
    for (;;) {
        Hit hit = trace(ray, false, stage == CATCHER_STAGE);
        bool is_hit = hit.object != NONE;
        if (stage == PRIMARY_STAGE) {
            if (is_hit && objects[hit.object].role == VIRTUAL) {
                sums.coverage += 1.0;
            } else {
                if (!has_catchers)
                    break;
                ray.t_max = is_hit ? hit.t : INFINITY;
                ray.mask = CATCHER_MASK;
                stage = CATCHER_STAGE;
                continue;
            }
        } else if (stage == PATH_STAGE) {
            if (has_area_lights)
                light += path.throughput * arriving_from_area_lights(ray.origin, ray.direction, hit.t,
                                                                     path.inverse_density, path.depth);
            if (!is_hit)
                light += path.throughput * arriving_from_environment(ray.direction, path.inverse_density,
                                                                     float(frame.light_samples));
        }
        if (is_hit) {
            Surface s = surface_at(ray, hit, true);
            vec3 direction = normalize(ray.direction);
            uint material = objects[hit.object].material, model = materials[material].model;
            bool catches = stage == CATCHER_STAGE, is_lit = model != MIRROR && model != GLASS && model != UNLIT;
            Random path_random = Random(random.pixel ^ (path.depth << 12), random.seed, random.number);
            if ((is_lit || model == UNLIT) && !catches)
                add_material(s, hit, -direction);
            if (model == UNLIT && !catches)
                light += path.throughput * s.emission;
            if (is_lit || catches) {
                bool rays_follow = path.depth < frame.max_depth;
                DirectLight sum = direct_light(s, -direction, catches, rays_follow, path_random);
                if (catches) {
                    sums.caught += 1.0;
                    sums.irradiance += sum.irradiance;
                    sums.hidden += sum.hidden;
                    return;
                }
                light += path.throughput * sum.light;
            }
            light += scatter(path, s, direction, material, path_random);
        }
        if (stack_size == 0)
            break;
        path = stack[--stack_size];
        ray = Ray(path.origin, path.direction, INFINITY, ALL_MASKS | OF_EYE);
        stage = PATH_STAGE;
    }
    // Radiance is averaged in linear light and encoded only once. sRGB codes are not linear and limited to 1, so
    // averaging them would darken noise and highlights.
    sums.light += vec3(bounded_radiance(light.x), bounded_radiance(light.y), bounded_radiance(light.z));
}

// Returns a pixel's RGBA code, the mean of all samples so far. Virtual objects and catchers are averaged separately.
// They are then blended in sRGB, weighted by their shares of the pixel, as the compositor blends them with the video.
// Edges thus have no halo on any background.
uint shade_pixel(uvec2 position) {
    uint pixel = position.y * frame.width + position.x;
    Sums sums = Sums(vec3(0.0), 0.0, vec3(0.0), 0.0, vec3(0.0), 0.0, vec3(0.0));
    for (uint i = 0u; i < frame.sample_count; ++i) {
        vec3 direction;
        if (direction_of(pixel, frame.samples[i].xy, direction))
            trace_sample(direction, random_of_pixel(position, frame.first_sample + i), sums);
    }
    if (frame.accumulates != 0u) {
        if (frame.first_sample > 0u) {
            sums.light += history[pixel].light;
            sums.coverage += history[pixel].coverage;
            sums.hidden += history[pixel].hidden;
            sums.irradiance += history[pixel].irradiance;
            sums.caught += history[pixel].caught;
        }
        history[pixel] = sums;
    }
    float count = float(frame.first_sample + frame.sample_count);
    float coverage = sums.coverage * (1.0 / count), per_hit = 1.0 / max(sums.coverage, 1.0);
    vec3 light = sums.light * per_hit;
    if (!has_catchers || !(largest(sums.hidden) > 0.0))
        return packed(uvec4(srgb8(light.x), srgb8(light.y), srgb8(light.z), code_of(coverage)));
    vec4 shadow = catcher_shadow(vec3(fraction_of(sums.hidden.x, sums.irradiance),
                                      fraction_of(sums.hidden.y, sums.irradiance),
                                      fraction_of(sums.hidden.z, sums.irradiance)));
    shadow.a *= fraction_of(sums.caught, count);
    float alpha = coverage + shadow.a;
    vec3 colour = (vec3(srgb_encode(light.x), srgb_encode(light.y), srgb_encode(light.z)) * coverage +
                   shadow.rgb * shadow.a) *
                  (1.0 / max(alpha, 1e-6));
    return packed(uvec4(code_of(colour.x), code_of(colour.y), code_of(colour.z), code_of(alpha)));
}

void write_pixel(uvec2 position) {
    position.y += band.first_row;
    if (position.x >= frame.width || position.y >= frame.height)
        return;
    uint pixel = shade_pixel(position);
    image_pixels[position.y * frame.width + position.x] = pixel;
    if (pixel >> 24 != 0u)
        mark_drawn(position);
}
