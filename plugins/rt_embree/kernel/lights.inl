// SPDX-License-Identifier: Apache-2.0
//
// Direct light from lamps and the environment, and its occlusion.
#pragma once
#include "random.inl"
#include "surface.inl"

enum Purpose : int { environment_purpose = 1, glass_purpose, rough_purpose, first_lamp_purpose };

// A sampled point of a light source, relative to the surface point of each lane.
struct LightSample {
    Vec3 to_light; // vector from the surface to the sampled point; of unit length if the light is infinitely far
    float t_far;   // end of the shadow ray in lengths of `to_light`: 1, or infinity
    bool from_environment;
    Vec3 direction;   // of `to_light`, unit length
    Float cosine;     // cosine of the angle of incidence; 0 if the light is behind the surface
    Float irradiance; // at perpendicular incidence, per unit of intensity
};

ARHOST_INLINE LightSample make_light_sample(const Surface &s, Vec3 to_light, float t_far, Float irradiance) {
    LightSample sample;
    sample.to_light = to_light;
    sample.t_far = t_far;
    sample.from_environment = false;
    sample.direction = normalize(to_light);
    sample.cosine = lambert_on_facet(s.normal, s.geometric_normal, sample.direction);
    sample.irradiance = irradiance;
    return sample;
}

ARHOST_INLINE bool is_extended(const arhost_light &light) {
    return light.type == ARHOST_LIGHT_RECTANGLE || light.type == ARHOST_LIGHT_SPHERE;
}

// `uv` selects the sampled point of an area light.
ARHOST_INLINE LightSample sample_light(const arhost_light &light, const Surface &s, Pair uv) {
    if (light.type == ARHOST_LIGHT_DIRECTIONAL)
        return make_light_sample(s, -splat(light.direction), far_away, Float(1.0f));
    Vec3 to_light = splat(light.position) - s.position;
    if (light.type == ARHOST_LIGHT_RECTANGLE)
        to_light = vector_to_rectangle(to_light, splat(light.axis_u), splat(light.axis_v), uv.u, uv.v);
    else if (light.type == ARHOST_LIGHT_SPHERE)
        to_light = vector_to_disc(to_light, Float(light.radius), uv.u, uv.v);
    const Bool falls_off = bool_of(light.falloff == ARHOST_FALLOFF_INVERSE_SQUARE);
    LightSample sample = make_light_sample(s, to_light, 1, point_light_falloff(falls_off, dot(to_light, to_light)));
    if (light.type == ARHOST_LIGHT_SPOT)
        sample.irradiance =
            sample.irradiance * spot_attenuation(dot(splat(light.direction), -sample.direction),
                                                 Float(light.cosine_inner), Float(light.cosine_outer));
    if (light.type == ARHOST_LIGHT_RECTANGLE)
        sample.irradiance = sample.irradiance * lambert(splat(light.direction), -sample.direction);
    return sample;
}

// The visibility of a light source from the surface point of each lane.
struct Visibility {
    Bool unoccluded; // no opaque object is in between
    Bool is_tinted;  // glass is in between
    Vec3 tint;       // transmittance of the glass in between
};

// Returns the transmittance of the glass between the surface points and a light source. Sets `is_tinted` for lanes
// with glass in between.
ARHOST_INLINE Vec3 glass_tint(const Scene &scene, Vec3 origin, const LightSample &sample, Bool active,
                              Bool &is_tinted) {
    constexpr int max_surfaces =
        64; // ignores further surfaces: rays may alternate endlessly between coincident faces
    Vec3 tint = white(), start = origin, remaining = sample.to_light;
    for (int i = 0; i < max_surfaces && any(active); ++i) {
        RTCRayHit16 rays;
        set_ray(rays.ray, start, remaining, Float(sample.t_far), Int(glass_mask));
        active = trace(scene, scene.root, make_query(Coherence::incoherent), rays, active);
        if (!any(active))
            break;
        is_tinted = is_tinted | active;
        const Surface s = surface_at(scene, rays, active);
        const Float cosine = abs(dot(s.normal, sample.direction));
        for_each_object(scene, rays.hit, active, [&](const Object &object, Bool here) {
            tint = select(here, tint * glass_shadow(splat(object.material->shadow_attenuation), cosine), tint);
        });
        const Vec3 next = s.position - s.geometric_normal * s.offset;
        if (sample.t_far < far_away)
            remaining = remaining - (next - start);
        start = next;
        active = active & (largest(tint) > Float(1e-3f));
    }
    return tint;
}

// Real surfaces (catchers and occluders) cast no virtual shadow on each other: the video already shows their shadows.
ARHOST_INLINE Visibility visibility_of(const Scene &scene, const LightSample &sample, const Surface &s, Bool active) {
    const Vec3 origin = s.position + s.geometric_normal * s.offset;
    const Vec3 to_light = sample.t_far < far_away ? sample.to_light - s.geometric_normal * s.offset : sample.to_light;
    RTCRay16 rays;
    set_ray(rays, origin, to_light, Float(sample.t_far),
            select(s.is_real, Int(opaque_mask), Int(opaque_mask | catcher_mask | occluder_mask)));
    Visibility visibility;
    visibility.unoccluded = active & ~blocked(scene, rays, active);
    visibility.is_tinted = bool_of(false);
    visibility.tint = white();
    if (scene.has_glass && any(visibility.unoccluded))
        visibility.tint = glass_tint(scene, origin, sample, visibility.unoccluded, visibility.is_tinted);
    return visibility;
}

// For each lane, returns the index (from 0, relative to `first`) of the first cumulative sum above `value`, found by
// binary search.
ARHOST_INLINE Int search(const float *sums, Int first, std::int32_t count, Float value) {
    Int low(0), high(count - 1);
    for (std::int32_t remaining = count; remaining > 1; remaining = (remaining + 1) / 2) {
        const Int middle = (low + high) >> Int(1);
        const Bool larger = gather(sums, first + middle) > value;
        const Bool searching = low < high;
        high = select(searching & larger, middle, high);
        low = select(searching & ~larger, middle + Int(1), low);
    }
    return low;
}

ARHOST_INLINE Vec3 environment_light(const Scene &scene, Vec3 direction) {
    const Environment &environment = scene.environment;
    if (!environment.image)
        return splat(scene.background);
    const Vec3 d = transform(environment.environment_from_world, direction);
    return sample_texture(scene, *environment.image, equirectangular_u(d), equirectangular_v(d)).colour *
           Float(environment.intensity);
}

struct EnvironmentSample {
    LightSample light_sample;
    Vec3 intensity; // linear colour; `light_sample.irradiance` accounts for the sampling density
};

// Samples a direction in proportion to the environment's luminance. `uv`: random numbers from 0 to 1.
ARHOST_INLINE EnvironmentSample sample_environment(const Scene &scene, const Surface &s, Pair uv) {
    const Environment &environment = scene.environment;
    const Texture &image = *environment.image;
    const Int row = search(environment.rows, Int(0), image.height, uv.v);
    const auto step = [](const float *sums, Int first, Int i) __attribute__((always_inline)) {
        const Float before =
            select(Int(0) < i, gather(sums, first + select(Int(0) < i, i - Int(1), Int(0))), Float(0.0f));
        return Pair{before, gather(sums, first + i) - before};
    };
    const Pair row_step = step(environment.rows, Int(0), row);
    const Int first = row * Int(image.width);
    const Int column = search(environment.columns, first, image.width, uv.u);
    const Pair column_step = step(environment.columns, first, column);
    const Float x = to_float(column) + fraction_of_step(uv.u, column_step.u, column_step.v);
    const Float y = to_float(row) + fraction_of_step(uv.v, row_step.u, row_step.v);
    const Float u = x * Float(1.0f / static_cast<float>(image.width)),
                v = y * Float(1.0f / static_cast<float>(image.height));
    const Vec3 d = equirectangular_direction(u, v);
    // The inverse of a rotation matrix is its transpose.
    const float *m = environment.environment_from_world;
    const Vec3 to_light{dot(splat(m), d), dot(splat(m + 3), d), dot(splat(m + 6), d)};
    const Float texels = Float(static_cast<float>(image.width) * static_cast<float>(image.height));
    const Float density = equirectangular_density(row_step.v * column_step.v * texels, v);
    EnvironmentSample sample;
    sample.light_sample = make_light_sample(s, to_light, far_away, irradiance_of_density(density));
    sample.light_sample.from_environment = true;
    // The colour is not interpolated, because the density is not: the light of a bright neighbouring texel would be
    // divided by the low density of this texel, which causes bright noise.
    sample.intensity = texel_at(scene, image, column, row).colour * Float(environment.intensity);
    return sample;
}

// Calls use(light_sample, intensity, fraction) for each sample of each light source. `fraction` is the reciprocal of
// the number of samples of that light source.
template <class Use>
ARHOST_INLINE void for_each_light(const Frame &frame, const Surface &s, const Random &random, Use use) {
    const Scene &scene = frame.scene;
    for (std::uint32_t i = 0; i < scene.light_count; ++i) {
        const arhost_light &light = scene.lights[i];
        const int count = is_extended(light) ? frame.light_samples : 1;
        for (int point = 0; point < count; ++point) {
            Pair uv{Float(0.5f), Float(0.5f)};
            if (is_extended(light))
                uv = pair(random, first_lamp_purpose + static_cast<int>(i), point, count);
            use(sample_light(light, s, uv), splat(light.intensity), 1 / static_cast<float>(count));
        }
    }
    if (scene.environment.image)
        for (int point = 0; point < frame.light_samples; ++point) {
            const EnvironmentSample sample =
                sample_environment(scene, s, pair(random, environment_purpose, point, frame.light_samples));
            use(sample.light_sample, sample.intensity, 1 / static_cast<float>(frame.light_samples));
        }
}

// Returns the radiance that surfaces other than mirrors and glass send towards the ray's origin: ambient light,
// emission and the reflected direct light.
ARHOST_INLINE Vec3 direct_light(const Frame &frame, const Surface &s, Vec3 to_eye, Bool active,
                                const Random &random) {
    Vec3 sum = s.ambient * splat(frame.scene.ambient) + s.emission;
    for_each_light(frame, s, random, [&](const LightSample &sample, Vec3 intensity, float fraction) {
        const Bool facing = active & (sample.cosine > Float(0.0f)) & (sample.irradiance > Float(0.0f));
        if (!any(facing))
            return;
        const Visibility visibility = visibility_of(frame.scene, sample, s, facing);
        if (!any(visibility.unoccluded))
            return;
        Vec3 reflected = s.diffuse * sample.cosine;
        if (s.any_specular)
            reflected = reflected + select(s.is_rough, black(),
                                           s.specular * phong(s.normal, sample.direction, to_eye, s.exponent));
        if (s.any_rough) {
            const Vec3 half_vector = normalize(sample.direction + to_eye);
            const Vec3 fresnel = schlick(s.specular, dot(to_eye, half_vector));
            const Float lobe = ggx_lobe(sample.cosine, dot(s.normal, to_eye), dot(s.normal, half_vector), s.alpha);
            // The secondary ray adds the specular reflection of the environment.
            const Vec3 specular = sample.from_environment ? black() : fresnel * lobe;
            reflected = select(s.is_rough, s.diffuse * (white() - fresnel) * sample.cosine + specular, reflected);
        }
        sum = sum + reflected * visibility.tint * intensity *
                        select(visibility.unoccluded, sample.irradiance * Float(fraction), Float(0.0f));
    });
    return sum;
}

// The overlay's alpha and colour at a shadow catcher.
struct CatcherShadow {
    Float alpha;
    Vec3 colour; // linear
};

// Computes the shadow on a catcher from the fraction of its irradiance that virtual objects block.
ARHOST_INLINE CatcherShadow catcher_shadow(const Frame &frame, const RTCRayHit16 &rays, Bool active,
                                           const Random &random) {
    const Scene &scene = frame.scene;
    const Surface s = surface_at(scene, rays, active);
    Float irradiance = 0.0f, hidden_part = 0.0f, tinted_part = 0.0f;
    Vec3 weighted_colour = black(); // weighted sum of each channel's alpha; used for coloured shadows only
    for_each_light(frame, s, random, [&](const LightSample &sample, Vec3 intensity, float fraction) {
        const Bool facing = active & (sample.cosine > Float(0.0f));
        if (!any(facing))
            return;
        const Float power = intensity.x + intensity.y + intensity.z;
        const Float weight = select(facing, sample.cosine * sample.irradiance * power * Float(fraction), Float(0.0f));
        const Visibility visibility = visibility_of(scene, sample, s, facing);
        const Bool hidden = facing & ~visibility.unoccluded;
        irradiance = irradiance + weight;
        hidden_part = hidden_part + select(hidden, weight, Float(0.0f));
        tinted_part =
            tinted_part + select(facing & visibility.is_tinted, weight, Float(0.0f)); // a tinted light is not hidden
        if (scene.coloured_shadows) {
            const Vec3 opaque = white() * Float(scene.shadow_alpha_opaque);
            const Vec3 through = select(visibility.is_tinted, opaque * (white() - visibility.tint), black());
            weighted_colour = weighted_colour + select(hidden, opaque, through) * weight;
        }
    });
    const Float alpha =
        shadow_alpha(fraction_of_light(hidden_part, irradiance), fraction_of_light(tinted_part, irradiance),
                     Float(scene.shadow_alpha_opaque), Float(scene.shadow_alpha_translucent));
    CatcherShadow shadow{select(active, alpha, Float(0.0f)), black()};
    if (scene.coloured_shadows) {
        // Each colour channel has its own alpha, but the image has one alpha for all: the largest. The shadow's
        // colour compensates for channels that this alpha would darken too much.
        const Vec3 channel_alpha{fraction_of_light(weighted_colour.x, irradiance),
                                 fraction_of_light(weighted_colour.y, irradiance),
                                 fraction_of_light(weighted_colour.z, irradiance)};
        shadow.alpha = select(active, largest(channel_alpha), Float(0.0f));
        const auto colour = [&](Float channel) __attribute__((always_inline)) {
            return srgb_decode(shadow_colour_encoded(channel, shadow.alpha));
        };
        shadow.colour = {colour(channel_alpha.x), colour(channel_alpha.y), colour(channel_alpha.z)};
    }
    return shadow;
}
