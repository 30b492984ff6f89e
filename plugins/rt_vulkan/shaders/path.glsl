// SPDX-License-Identifier: Apache-2.0
//
// The path integrator: computes the added light and the transmittance of a pixel. Equivalent to rt_embree's
// kernel/path.inl. A path that starts at a virtual object collects radiance; one that starts at a catcher collects the
// change of its diffuse light, relative to that without virtual objects, or the change of the light that it mirrors.

// Paths of fewer bounces are not ended at random.
const uint first_roulette_depth = 2u;

const int PRIMARY_STAGE = 1, CATCHER_STAGE = 2, PATH_STAGE = 3, NEAR_CENTRE_STAGE = 4;

// The surfaces that receive the light of sampled light sources.
const int LIT_SURFACE = 1, CATCHER_SURFACE = 2, FILMED_SURFACE = 3;

// Bounds a sample, so that a single random ray that hits a tiny, very bright light does not dominate the pixel.
float bounded(float value) {
    return abs(value) < 1e30 ? clamp(value, -frame.max_radiance, frame.max_radiance) : 0.0; // NaN: 0
}
vec3 bounded(vec3 rgb) {
    return vec3(bounded(rgb.x), bounded(rgb.y), bounded(rgb.z));
}

// Returns whether a path from the eye has been scattered only by mirrors and glass, and by no random choice.
bool is_of_eye(Path path) {
    return !path.is_random && path.inverse_density == 0.0 && path.plane == OBJECT_PLANE;
}

// Returns whether the denoiser uses `seen` of a path.
bool is_seen(Path path) {
    return is_denoised() && is_of_eye(path);
}

// A sum over the samples of a pixel: the light of lamps, of the environment and of the video that mirrors and glass show,
// and the albedo of virtual objects that they show. Only paths with is_seen() count.
vec3 seen;

// `is_translucent`: the surface, which adds its own part.
void add_seen(Path path, vec3 light, bool is_translucent) {
    if ((path.depth > 0u || is_translucent) && is_seen(path))
        seen += max(bounded(path.throughput * light), 0.0);
}

// Light that is seen in mirrors and through glass should have no noise.
float importance_of(Path path) {
    return is_seen(path) ? 16.0 : 1.0;
}

// Ends paths at random, so that those that go on have about the same throughput, 1 / importance. `choice`: 0 to 1.
bool survives(inout Path path, float importance, float choice, inout vec3 throughput) {
    if (!(largest(throughput) > 0.0))
        return false;
    if (path.depth < first_roulette_depth)
        return true;
    float chance = clamp(largest(throughput) * importance, 0.05, 1.0);
    throughput *= 1.0 / chance;
    path.is_random = path.is_random || chance < 1.0;
    return choice < chance;
}
vec2 roulette_pair(Path path, Random random) {
    return path.depth < first_roulette_depth ? vec2(0.0) : path_pair(random, ROULETTE_DIMENSION, 0u, 1u);
}

// Pushes a reflected or a refracted ray, chosen at random; both at the first hit, which the eye sees most clearly, and
// for the denoiser where glass is seen.
void scatter_path_in_glass(Path path, Surface s, vec3 direction, uint material, float choice, Random random) {
    vec2 uv = materials[material].roughness > 0.0 ? path_pair(random, FACET_DIMENSION, 0u, 1u) : vec2(0.0);
    path.is_random = path.is_random || materials[material].roughness > 0.0;
    GlassScatter glass = scatter_at_glass(s, direction, material, uv, materials[material].roughness > 0.0);
    vec3 arriving = path.throughput * glass.transmittance;
    vec3 by_reflection = arriving * glass.reflection_tint * glass.unmasked_reflected,
         by_refraction = arriving * glass.refraction_tint * glass.unmasked_refracted;
    bool reflects = choice < glass.reflectance, refracts = !reflects;
    float importance = importance_of(path);
    bool is_both = path.depth == 0u || importance > 1.0;
    if (is_both) {
        by_reflection *= glass.reflectance;
        by_refraction *= 1.0 - glass.reflectance;
        reflects = true;
        refracts = glass.reflectance < 1.0;
    }
    vec2 roulette = roulette_pair(path, random);
    Path next = path;
    if (reflects && survives(next, importance, roulette.x, by_reflection))
        push(next, above(s), glass.reflected, by_reflection, -abs(path.inverse_density));
    next = path;
    if (refracts && survives(next, importance, is_both ? roulette.y : roulette.x, by_refraction))
        push(next, below(s), glass.refracted, by_refraction, -abs(path.inverse_density));
}

// Pushes a ray that the surface scatters; in glass, there may be two.
void scatter_path(Path path, Surface s, vec3 direction, uint material, Random random) {
    vec2 choice = path_pair(random, CHOICE_DIMENSION, 0u, 1u);
    float transmission = materials[material].model == GLASS ? 1.0 : s.transmission;
    if (has_glass && choice.y < transmission) {
        path.is_random = path.is_random || transmission < 1.0;
        scatter_path_in_glass(path, s, direction, material, choice.y / transmission, random);
        return;
    }
    vec3 mirror_reflectance;
    float mirror_chance = mirror_chance_of(s, direction, material, mirror_reflectance);
    if (choice.y < mirror_chance) {
        vec3 throughput = path.throughput * mirror_reflectance * (1.0 / max(mirror_chance, 1e-6));
        path.is_random = path.is_random || mirror_chance < 1.0;
        if (survives(path, importance_of(path), roulette_pair(path, random).x, throughput))
            push(path, above(s), reflected(s, direction), throughput, -abs(path.inverse_density));
        return;
    }
    vec3 to_eye = -direction;
    float specular = specular_chance(s, to_eye), by_coat = coat_chance(s, to_eye);
    vec2 uv = path_pair(random, SCATTER_DIMENSION, 0u, 1u);
    bool is_coat = choice.x >= 1.0 - by_coat;
    vec3 to = is_coat || choice.x < specular * (1.0 - by_coat)
                  ? mirror_direction(direction, is_coat ? ggx_half_vector(s.coat_normal, to_eye, s.coat_alpha, uv.x, uv.y)
                                                        : half_vector_of(s, to_eye, uv))
                  : cosine_direction(s.normal, uv.x, uv.y);
    float density = scattering_density(s, to_eye, to, specular, by_coat);
    vec3 throughput = path.throughput * scattering(s, to_eye, to) *
                      (0.318309886 / max(density * (1.0 - mirror_chance), 1e-20));
    if (dot(to, s.normal) > 0.0 && dot(to, s.geometric_normal) > 0.0 && density > 0.0 &&
        survives(path, 1.0, roulette_pair(path, random).x, throughput))
        push(path, above(s), to, throughput, 1.0 / max(density, 1e-30));
}

// Returns the light of sampled light sources that a lit surface reflects to the eye. For a real surface, returns the
// change of its irradiance (divided by π) by virtual objects: minus the light that they hide, plus that of emissive
// ones. Adds the light of a catcher's gloss to `mirrored` and `covered`. `form_factors`: of
// the virtual objects, for a real surface. `scatters`: whether a scattered ray follows; `mirrors`: whether one of the
// gloss does.
vec3 sampled_light(int receiver, Surface s, float form_factors, vec3 to_eye, uint depth, bool scatters, bool mirrors,
                   Random random) {
    // The eye sees filmed surfaces in mirrors and glass, so they get as many samples as those that it sees directly.
    uint count = source_samples(receiver == FILMED_SURFACE ? depth - 1u : depth);
    float specular = receiver == LIT_SURFACE ? specular_chance(s, to_eye) : 0.0;
    float by_coat = receiver == LIT_SURFACE ? coat_chance(s, to_eye) : 0.0;
    vec3 sum = vec3(0.0);
    for (uint i = 0u; i < count; ++i) {
        SourceSample source = sample_source(s, random, i, count);
        float cosine = dot(s.normal, source.direction);
        bool hides = receiver != LIT_SURFACE && !source.is_virtual;
        if (!(cosine > 0.0) || !(largest(source.light) > 0.0) ||
            (hides && (!can_meet_virtual(s.position, source.to_light, source.t_max) ||
                       is_visible(s, source, OPAQUE_MASK | GLASS_MASK))))
            continue;
        // Light that passes through glass is not sampled: refracted rays and photons find it.
        bool is_open = (hides && frame.has_several_real == 0u && !has_gloss) ||
                       is_visible(s, source, hides ? CATCHER_MASK | OCCLUDER_MASK : ALL_MASKS);
        // In front of a lamp, real objects already cast a shadow in the video. The environment shows them, too, so that
        // virtual objects before them hide its light.
        if (!is_open && !(hides && source.is_environment && is_virtual_first(s, source)))
            continue;
        float other_density = 0.0; // of scattered rays
        if (scatters && !hides)
            other_density = receiver == LIT_SURFACE ? scattering_density(s, to_eye, source.direction, specular, by_coat)
                                                    : bounce_density(s, source.direction, form_factors);
        float weight = balance_weight(source.density, other_density);
        if (has_gloss && receiver == CATCHER_SURFACE && s.is_rough && is_open) {
            float density = mirrors ? scattering_density(s, to_eye, source.direction, 1.0, 0.0) : 0.0;
            vec3 light = gloss(s, to_eye, source.direction) * source.light * balance_weight(source.density, density);
            if (hides)
                covered += light;
            else
                mirrored += light;
        }
        if (hides)
            sum -= source.light * cosine;
        else if (receiver != LIT_SURFACE)
            sum += source.light * (cosine * weight);
        else
            sum += (scattering(s, to_eye, source.direction) * weight + highlight(s, to_eye, source.direction)) *
                   source.light;
    }
    return sum;
}

// The denoiser leaves bright single paths visible for many frames. So surfaces have wider highlights where another
// surface, but a mirror or glass, scatters their light (A. Kaplanyan and C. Dachsbacher, Path Space Regularization
// for Holistic and Robust Light Transport, Eurographics 2013).
const float LEAST_SCATTERED_ALPHA = 0.3;

// Reciprocal of a real surface's irradiance without virtual objects.
float reciprocal(float irradiance) {
    return frame.least_irradiance > 0.0 ? 1.0 / max(irradiance, frame.least_irradiance) : 0.0;
}

// Returns the light that a ray brings to its origin, without that of the rays it pushes. `is_bounce`: the ray comes from
// a surface that the video shows, and brings light of virtual objects only.
vec3 light_along(Path path, bool is_bounce, Ray ray, Hit hit, int stage, Random random) {
    bool is_covered = has_gloss && path.plane == COVERED_PLANE, is_mirrored = has_gloss && path.plane == MIRRORED_PLANE && path.depth == 1u;
    bool is_hit = hit.object != NONE;
    vec3 sum = vec3(0.0);
    if (is_bounce && !is_hit)
        return sum;
    // Photons bring the light of lamps that reaches a scattering surface off mirrors and through glass.
    if (has_area_lights && path.depth > 0u && (!is_bounce || is_mirrored) && !(path.inverse_density < 0.0))
        sum = arriving_from_area_lights(ray.origin, ray.direction, hit.t, path.inverse_density, path.depth);
    Surface s;
    if (is_hit) {
        s = surface_at(ray, hit, true);
        if (is_bounce && s.is_real)
            return vec3(0.0);
    }
    if (is_mirrored) { // another ray finds what the virtual object covers, except lamps before the object
        covered -= path.throughput * sum;
        sum = vec3(0.0);
        stack[stack_size] = path;
        stack[stack_size++].plane = COVERED_PLANE;
    }
    // Rays that only mirrors and glass have scattered see the video also where it shows the environment, which is
    // nearer than infinity there.
    vec3 video;
    bool is_filmed = false;
    if (may_have_video && frame.has_video != 0u && path.depth > 0u &&
        (is_hit ? s.is_real : path.inverse_density == 0.0 && path.plane == OBJECT_PLANE)) {
        vec3 to_point = is_hit ? s.position - frame.eye : ray.direction;
        float end = is_hit ? 1.0 - s.offset * 4.0 / max(length(to_point), 1e-20) : INFINITY;
        // The video shows the side of the surface that faces the camera. A bright video may be saturated.
        is_filmed = filmed_towards(to_point, video) &&
                    (!is_hit || dot(s.geometric_normal, to_point) < 0.0);
        if (is_filmed && (frame.has_several_real != 0u || !is_hit)) // the video may show a nearer real surface
            is_filmed = trace(Ray(frame.eye, to_point, end, CATCHER_MASK | OCCLUDER_MASK), true, false).object == NONE;
    }
    if (!is_hit) {
        vec3 light = arriving_from_environment(ray.direction, path.inverse_density,
                                               frame.environment_chance * float(source_samples(path.depth - 1u)));
        if (is_filmed)
            light = largest(video) < 0.95 ? video : max(light, video);
        sum += light;
        add_seen(path, sum, false);
        return sum;
    }
    if (is_covered && is_filmed)
        return sum + video;
    vec3 direction = normalize(ray.direction);
    uint material = objects[hit.object].material;
    int receiver = stage == CATCHER_STAGE ? CATCHER_SURFACE : is_filmed ? FILMED_SURFACE : LIT_SURFACE;
    bool is_unlit = materials[material].model == UNLIT;
    bool is_lit = materials[material].model != MIRROR && materials[material].model != GLASS && !is_unlit;
    bool scatters = path.depth < frame.max_depth;
    vec3 relative = vec3(1.0), before = vec3(0.0); // relative: factor of the reflected light
    if ((is_lit || is_unlit) && (receiver != CATCHER_SURFACE || has_gloss))
        add_material(s, hit, -direction);
    if (s.is_rough && !s.is_real)
        bend_normals(s, -direction);
    // The eye sees through a translucent surface in proportion to 1 − its opacity.
    float share = 1.0, lit_share = 1.0 - s.transmission;
    if (has_holes && s.opacity < 1.0 && is_of_eye(path)) {
        vec3 passing = path.throughput * (1.0 - s.opacity);
        if (scatters && largest(passing) > min_throughput)
            push(path, below(s), direction, passing, path.inverse_density);
        share = s.opacity;
    }
    Path behind = path; // with the light of lamps before the surface
    path.throughput *= share;
    if (is_denoised()) {
        if (path.inverse_density != 0.0 && !(s.transmission > 0.0)) {
            s.alpha = max(s.alpha, LEAST_SCATTERED_ALPHA);
            s.tangent_alpha = max(s.tangent_alpha, s.alpha);
        }
        if (path.depth == 0u && kind_of(guides.surface) != SPECULAR_SURFACE) {
            guides.position = s.position;
            guides.normal = s.normal;
            guides.albedo = divisor_of(s, is_lit, is_unlit);
        }
        bool is_emissive = receiver == LIT_SURFACE && largest(s.emission) > 0.0;
        add_seen(behind, sum, false);
        add_seen(path,
                 receiver == FILMED_SURFACE ? video
                 : is_emissive              ? s.emission
                 : is_lit                   ? divisor_of(s, is_lit, is_unlit) * lit_share
                                            : vec3(0.0),
                 s.opacity < 1.0 || s.transmission > 0.0);
    }
    if (receiver != LIT_SURFACE || is_covered)
        before = irradiance_without_objects(s);
    if (is_covered)
        return sum + s.emission + s.diffuse * before;
    bool mirrors = false;
    if (receiver != LIT_SURFACE) {
        relative = vec3(reciprocal(before.x), reciprocal(before.y), reciprocal(before.z));
    } else if (largest(s.emission) > 0.0) {
        sum += s.emission * share *
               (path.depth > 0u ? balance_weight_of_ray(density_of_emitter(s, hit, direction, path.depth),
                                                        max(path.inverse_density, 0.0))
                                : 1.0);
    }
    if (receiver != LIT_SURFACE && s.is_rough)
        relative *= shadowed_share(s);
    if (has_gloss && receiver == CATCHER_SURFACE && s.is_rough) {
        matt = s.diffuse * passing_fresnel(s, dot(s.normal, -direction)) * before;
        mirrors = scatters && mirrors_virtual(s, -direction);
    }
    float form_factors = receiver == LIT_SURFACE ? 0.0 : form_factors_of(s);
    vec3 scattered = vec3(0.0);
    if (receiver != LIT_SURFACE || (is_lit && lit_share > 0.0)) {
        bool is_caught = receiver == CATCHER_SURFACE;
        PhotonLight by_photons = PhotonLight(vec3(0.0), vec3(0.0));
        if (!is_caught || shows(CAUSTICS_PART))
            by_photons = photon_light(receiver != LIT_SURFACE, s, -direction, random);
        scattered = by_photons.light;
        if (!is_caught || shows(SHADOW_PART))
            scattered += sampled_light(receiver, s, form_factors, -direction, path.depth, scatters, mirrors, random);
        scattered *= relative;
        if (receiver == CATCHER_SURFACE) // rays of the gloss do not see lamps behind mirrors and glass
            mirrored += by_photons.mirrored;
    }
    if (receiver == FILMED_SURFACE) {
        // If the described light is weaker than that of the video, the surface must not reflect more than it receives.
        relative = min(relative * video, vec3(1.0));
        scattered = video * (vec3(1.0) + scattered);
    }
    if (mirrors) // pushed first: when it is popped, the stack has space for the ray behind a virtual object
        push_mirrored(path, s, -direction, random);
    if (scatters && receiver != LIT_SURFACE && largest(relative) > 0.0) {
        if (receiver == FILMED_SURFACE || shows(BOUNCE_PART))
            push_bounce(path, s, form_factors, path.throughput * relative, random);
    } else if (scatters && receiver == LIT_SURFACE) {
        scatter_path(path, s, direction, material, random);
    }
    return sum + scattered * (share * (receiver == LIT_SURFACE ? lit_share : 1.0));
}

// Renders a sample and adds it to the pixel's sums. As in the other integrator, a single loop with a single call of
// trace() handles all kinds of rays that find surfaces. `near`: with denoising, the direction of a ray that mirrors and
// glass reflect and refract instead, if it meets the same object.
void trace_sample(vec3 direction, vec3 near, Random random, inout Sums sums) {
    vec3 light = vec3(0.0);
    mirrored = covered = matt = vec3(0.0);
    stack_size = 0;
    int stage = PRIMARY_STAGE;
    bool of_catcher = false;
    Path path = Path(frame.eye, direction, vec3(1.0), 0.0, 0u, OBJECT_PLANE, false);
    Ray ray = Ray(frame.eye, direction, INFINITY, OPAQUE_MASK | GLASS_MASK | OCCLUDER_MASK | OF_EYE);
    Hit of_centre;
    for (;;) {
        Hit hit = trace(ray, false, stage == CATCHER_STAGE);
        if (stage == NEAR_CENTRE_STAGE && hit.object != of_centre.object) {
            hit = of_centre;
            ray.direction = direction;
        }
        bool is_hit = hit.object != NONE;
        if (stage == PRIMARY_STAGE) {
            if (is_hit && objects[hit.object].role == VIRTUAL) {
                sums.coverage += 1.0;
                if (is_denoised()) {
                    uint surface = surface_of(hit);
                    bool is_first = guides.surface == 0u;
                    if (is_first)
                        guides.surface = surface;
                    if (kind_of(surface) == SPECULAR_SURFACE) {
                        if (is_first)
                            follow_specular(ray, hit);
                        of_centre = hit;
                        ray.direction = near;
                        stage = NEAR_CENTRE_STAGE;
                        continue;
                    }
                }
            } else {
                if (!has_catchers)
                    return;
                ray.t_max = is_hit ? hit.t : INFINITY;
                ray.mask = CATCHER_MASK;
                stage = CATCHER_STAGE;
                continue;
            }
        } else if (stage == CATCHER_STAGE) {
            if (!is_hit)
                return;
            of_catcher = true;
            path.plane = CHANGE_PLANE;
            if (is_denoised())
                guides.surface = surface_of(hit);
        }
        // The light of catchers and filmed surfaces changes only where they see virtual objects.
        bool is_bounce = path.plane >= FILMED_BIT || (stage == PATH_STAGE && path.depth == 1u &&
                                                  (path.plane == CHANGE_PLANE || path.plane == MIRRORED_PLANE));
        path.plane &= FILMED_BIT - 1u;
        Random of_vertex = Random(random.pixel + path.plane * TILE_PIXELS + (path.depth << 12), random.seed, random.number);
        vec3 arriving = path.throughput * light_along(path, is_bounce, ray, hit, stage, of_vertex);
        if (has_gloss && path.plane == MIRRORED_PLANE)
            mirrored += arriving;
        else if (has_gloss && path.plane == COVERED_PLANE)
            covered += arriving;
        else
            light += arriving;
        if (stack_size == 0)
            break;
        path = stack[--stack_size];
        ray = Ray(path.origin, path.direction, INFINITY,
                  has_gloss && path.plane == COVERED_PLANE ? CATCHER_MASK | OCCLUDER_MASK : ALL_MASKS);
        if (is_of_eye(path))
            ray.mask |= OF_EYE;
        stage = PATH_STAGE;
    }
    light = bounded(light);
    if (of_catcher) {
        sums.hidden += light;
        sums.light += bounded(mirrored);
        sums.covered += bounded(covered);
        sums.matt += matt;
    } else {
        sums.light += light;
    }
}

// Removes the light that catchers mirror only without virtual objects. It is part of the video, so that the
// transmittance applies to it, too. A saturated video shows less than that; there, the catcher's diffuse light remains.
// `light`, `diffuse`: Sums.covered and Sums.matt, means over the samples that hit no virtual object.
void remove_covered(vec3 light, vec3 diffuse, uvec2 position, inout vec3 added, inout vec3 transmittance) {
    transmittance = max(transmittance, 0.0);
    if (may_have_video && frame.has_video != 0u) {
        vec2 at = (vec2(position) + 0.5) / vec2(frame.width, frame.height);
        vec3 video = max(sample_level(frame.video_texture, 0, at).rgb, vec3(1e-6));
        vec3 saturated = clamp(video * 5.0 - 4.0, 0.0, 1.0); // from 0.8 on
        transmittance *= max(vec3(1.0) - light / video, min(diffuse * saturated / video, 1.0));
    } else {
        added -= transmittance * light;
    }
}

// Returns the bits of a half-precision float, rounded to nearest, ties to even; packHalf2x16() may round otherwise.
uint half_of(float value) {
    float a = clamp(value, 0.0, 65504.0);
    uint bits = floatBitsToUint(a);
    if (a < 6.103515625e-5) // adding ½ shifts the bits of a subnormal half to the end of the mantissa
        return floatBitsToUint(a + 0.5) - (126u << 23);
    return ((bits + 0xfffu + ((bits >> 13) & 1u)) >> 13) - (112u << 10);
}
uvec2 halves_of(vec3 rgb) {
    return uvec2(half_of(rgb.x) | (half_of(rgb.y) << 16), half_of(rgb.z));
}

// Pixels that show mirrors and glass get more samples, as what they show has edges. Returns the offset of one: with the
// last of the others, one in each quarter of the pixel. In motion these are always the same, as jitter would flicker.
const uint MORE_SAMPLES = 3u;
vec2 further_offset(uint number) {
    const vec2 around[MORE_SAMPLES] = vec2[](vec2(0.0, -0.47), vec2(0.41, 0.235), vec2(-0.41, 0.235));
    if (frame.seen_moves != 0u)
        return around[number - 1u];
    vec2 at = frame.samples[frame.sample_count - 1u].xy, further = at - 0.5 * sign(at);
    return vec2((number & 1u) != 0u ? further.x : at.x, (number & 2u) != 0u ? further.y : at.y);
}

// Writes the input of the denoiser.
void write_layers(uint pixel, Sums sums) {
    bool is_specular = kind_of(guides.surface) == SPECULAR_SURFACE;
    float count = float(frame.sample_count + (is_specular ? MORE_SAMPLES : 0u));
    bool is_real = kind_of(guides.surface) == REAL_SURFACE;
    vec3 light = sums.hidden / count;
    if (is_real) {
        guides.albedo = sums.matt / count;
    } else {
        if (is_specular)
            guides.albedo = max(seen / count, LEAST_DIVISOR);
        light = sums.light / (max(guides.albedo, LEAST_DIVISOR) * count);
    }
    write_layer(POSITION_PLANE, pixel, guides.position);
    write_layer(NORMAL_PLANE, pixel, guides.normal);
    write_layer(ALBEDO_PLANE, pixel, guides.albedo);
    image_pixels[layer_word(SURFACE_PLANE, pixel)] = guides.surface;
    write_layer(LIGHT_PLANE, pixel, light);
    if (has_gloss)
        write_layer(GLOSS_PLANE, pixel, is_real ? (sums.light - sums.covered) / count : vec3(0.0));
}

void write_pixel(uvec2 position) {
    position.y += band.first_row;
    if (position.x >= frame.width || position.y >= frame.height)
        return;
    uint pixel = position.y * frame.width + position.x;
    Sums sums = Sums(vec3(0.0), 0.0, vec3(0.0), 0.0, vec3(0.0), 0.0, vec3(0.0));
    guides = Guides(vec3(0.0), vec3(0.0), vec3(0.0), 0u);
    seen = vec3(0.0);
    uint count_of_samples = frame.sample_count;
    for (uint i = 0u; i < count_of_samples; ++i) { // a single call of trace_sample(), which is large
        uint further = i < frame.sample_count ? 0u : i + 1u - frame.sample_count;
        vec2 at = further > 0u ? further_offset(further) : frame.samples[i].xy;
        if (is_denoised() && frame.seen_moves != 0u && further == 0u)
            at = vec2(0.0);
        vec3 centre, near;
        if (!direction_of(pixel, at, near))
            break;
        if (is_denoised())
            direction_of(pixel, vec2(0.0), centre);
        else
            centre = near;
        // The random numbers of further samples are far from those of all frames.
        Random random = random_of_pixel(position, frame.first_random + (further > 0u ? further << 28 : i));
        trace_sample(centre, near, random, sums);
        if (is_denoised() && i + 1u == frame.sample_count && kind_of(guides.surface) == SPECULAR_SURFACE)
            count_of_samples += MORE_SAMPLES;
    }
    if (is_denoised()) {
        write_layers(pixel, sums);
        return;
    }
    if (frame.accumulates != 0u) {
        if (frame.first_sample > 0u) {
            sums.light += history[pixel].light;
            sums.coverage += history[pixel].coverage;
            sums.hidden += history[pixel].hidden;
            sums.covered += history[pixel].covered;
            sums.matt += history[pixel].matt;
        }
        history[pixel] = sums;
    }
    float count = float(frame.first_sample + frame.sample_count);
    float coverage = sums.coverage == count ? 1.0 : sums.coverage / count; // GLSL's division may round otherwise
    vec3 added = sums.light / count, transmittance = vec3(1.0 - coverage) + sums.hidden / count;
    if (has_gloss && largest(sums.covered) > 0.0) {
        float caught = count * max(1.0 - coverage, 1e-3);
        remove_covered(sums.covered / caught, sums.matt / caught, position, added, transmittance);
    }
    if (frame.is_linear != 0u) {
        uvec4 halves = uvec4(halves_of(added), halves_of(transmittance));
        for (uint i = 0u; i < 4u; ++i)
            image_pixels[4u * pixel + i] = halves[i];
        if (halves != uvec4(0u, 0u, 0x3c003c00u, 0x3c00u))
            mark_drawn(position);
        return;
    }
    float removed = overlay_alpha(clamp(transmittance, 0.0, 65504.0));
    float alpha = frame.blends_codes != 0u ? alpha_of_light(1.0 - removed) : removed;
    vec3 colour = added * (1.0 / max(alpha, 1e-6));
    uint codes = packed(uvec4(srgb8(colour.x), srgb8(colour.y), srgb8(colour.z), code_of(alpha)));
    image_pixels[pixel] = codes;
    if (codes >> 24 != 0u)
        mark_drawn(position);
}
