// SPDX-License-Identifier: Apache-2.0
//
// What lamps and the environment send to surfaces, and what keeps it from them.
#pragma once
#include "random.inl"
#include "surface.inl"

enum Purpose : int { environment_purpose = 1, glass_purpose, rough_purpose, first_lamp_purpose };

// One point of a light, as the lanes' surface points see it.
struct Incidence {
    Vec3 way;  // to the light, as far as it is; of length 1 to what is infinitely far
    float end; // of the way: 1, or infinity
    bool from_environment;
    Vec3 direction;   // length 1
    Float cosine;     // of the surface's inclination; 0 where the light is behind it
    Float irradiance; // per unit of intensity, at cosine 1
};

ARHOST_INLINE Incidence incidence_along(const Surface &s, Vec3 way, float end, Float irradiance) {
    Incidence in;
    in.way = way;
    in.end = end;
    in.from_environment = false;
    in.direction = normalize(way);
    in.cosine = lambert_on_facet(s.normal, s.geometric_normal, in.direction);
    in.irradiance = irradiance;
    return in;
}

ARHOST_INLINE bool is_extended(const arhost_light &light) {
    return light.type == ARHOST_LIGHT_RECTANGLE || light.type == ARHOST_LIGHT_SPHERE;
}

// `where` chooses the point of an extended light.
ARHOST_INLINE Incidence incidence(const arhost_light &light, const Surface &s, Pair where) {
    if (light.type == ARHOST_LIGHT_DIRECTIONAL)
        return incidence_along(s, -splat(light.direction), far_away, Float(1.0f));
    Vec3 way = splat(light.position) - s.position;
    if (light.type == ARHOST_LIGHT_RECTANGLE)
        way = way_to_rectangle(way, splat(light.axis_u), splat(light.axis_v), where.u, where.v);
    else if (light.type == ARHOST_LIGHT_SPHERE)
        way = way_to_disc(way, Float(light.radius), where.u, where.v);
    const Bool falls_off = bool_of(light.falloff == ARHOST_FALLOFF_INVERSE_SQUARE);
    Incidence in = incidence_along(s, way, 1, point_light_falloff(falls_off, dot(way, way)));
    if (light.type == ARHOST_LIGHT_SPOT)
        in.irradiance = in.irradiance * spot_share(dot(splat(light.direction), -in.direction),
                                                   Float(light.cosine_inner), Float(light.cosine_outer));
    if (light.type == ARHOST_LIGHT_RECTANGLE)
        in.irradiance = in.irradiance * lambert(splat(light.direction), -in.direction);
    return in;
}

// What comes to the surface points from a light.
struct Passage {
    Bool open;      // nothing opaque lies between
    Bool is_tinted; // but glass does
    Vec3 tint;      // what it lets through
};

// The tint of the glass between surface points and a light.
ARHOST_INLINE Vec3 tint_on_the_way(const Scene &scene, Vec3 origin, const Incidence &in, Bool active,
                                   Bool &is_tinted) {
    constexpr int max_surfaces = 64; // what lies behind them is taken for clear: ends loops between coincident faces
    Vec3 tint = white(), start = origin, left = in.way;
    for (int i = 0; i < max_surfaces && any(active); ++i) {
        RTCRayHit16 rays;
        set_ray(rays.ray, start, left, Float(in.end), Int(glass_mask));
        active = trace(scene, scene.root, make_query(Coherence::incoherent), rays, active);
        if (!any(active))
            break;
        is_tinted = is_tinted | active;
        const Surface s = surface_at(scene, rays, active);
        const Float cosine = abs(dot(s.normal, in.direction));
        for_each_object(scene, rays.hit, active, [&](const Object &object, Bool here) {
            tint = select(here, tint * glass_shadow(splat(object.material->shadow_attenuation), cosine), tint);
        });
        // On behind it.
        const Vec3 next = s.position - s.geometric_normal * s.offset;
        if (in.end < far_away)
            left = left - (next - start);
        start = next;
        active = active & (largest(tint) > Float(1e-3f));
    }
    return tint;
}

// Real surfaces cast no shadow on each other: that one is in the video.
ARHOST_INLINE Passage passage(const Scene &scene, const Incidence &in, const Surface &s, Bool active) {
    const Vec3 origin = s.position + s.geometric_normal * s.offset;
    const Vec3 way = in.end < far_away ? in.way - s.geometric_normal * s.offset : in.way;
    RTCRay16 rays;
    set_ray(rays, origin, way, Float(in.end),
            select(s.is_real, Int(opaque_mask), Int(opaque_mask | catcher_mask | occluder_mask)));
    Passage passage;
    passage.open = active & ~blocked(scene, rays, active);
    passage.is_tinted = bool_of(false);
    passage.tint = white();
    if (scene.has_glass && any(passage.open))
        passage.tint = tint_on_the_way(scene, origin, in, passage.open, passage.is_tinted);
    return passage;
}

// The place of `value` in cumulative sums, lane by lane: the first that is larger.
ARHOST_INLINE Int search(const float *sums, Int first, std::int32_t count, Float value) {
    Int low(0), high(count - 1);
    for (std::int32_t left = count; left > 1; left = (left + 1) / 2) {
        const Int middle = (low + high) >> Int(1);
        const Bool larger = gather(sums, first + middle) > value;
        const Bool going_on = low < high;
        high = select(going_on & larger, middle, high);
        low = select(going_on & ~larger, middle + Int(1), low);
    }
    return low;
}

// The environment's light from a direction.
ARHOST_INLINE Vec3 environment_light(const Scene &scene, Vec3 direction) {
    const Environment &environment = scene.environment;
    if (!environment.image)
        return splat(scene.background);
    const Vec3 d = transform(environment.environment_from_world, direction);
    return sample_texture(scene, *environment.image, equirectangular_u(d), equirectangular_v(d)).colour *
           Float(environment.intensity);
}

struct EnvironmentSample {
    Incidence in;
    Vec3 light; // per density, as `intensity` of a lamp
};

// A direction chosen by the environment's brightness.
ARHOST_INLINE EnvironmentSample sample_environment(const Scene &scene, const Surface &s, Pair where) {
    const Environment &environment = scene.environment;
    const Texture &image = *environment.image;
    const Int row = search(environment.rows, Int(0), image.height, where.v);
    const auto step = [](const float *sums, Int first, Int i) __attribute__((always_inline)) {
        const Float before =
            select(Int(0) < i, gather(sums, first + select(Int(0) < i, i - Int(1), Int(0))), Float(0.0f));
        return Pair{before, gather(sums, first + i) - before};
    };
    const Pair row_step = step(environment.rows, Int(0), row);
    const Int first = row * Int(image.width);
    const Int column = search(environment.columns, first, image.width, where.u);
    const Pair column_step = step(environment.columns, first, column);
    const Float x = to_float(column) + place_in_step(where.u, column_step.u, column_step.v);
    const Float y = to_float(row) + place_in_step(where.v, row_step.u, row_step.v);
    const Float u = x * Float(1.0f / static_cast<float>(image.width)),
                v = y * Float(1.0f / static_cast<float>(image.height));
    const Vec3 d = equirectangular_direction(u, v);
    // The rotation's transpose is its inverse.
    const float *m = environment.environment_from_world;
    const Vec3 way{dot(splat(m), d), dot(splat(m + 3), d), dot(splat(m + 6), d)};
    const Float texels = Float(static_cast<float>(image.width) * static_cast<float>(image.height));
    const Float density = equirectangular_density(row_step.v * column_step.v * texels, v);
    EnvironmentSample sample;
    sample.in = incidence_along(s, way, far_away, irradiance_of_density(density));
    sample.in.from_environment = true;
    // The texel's own, as the density is: between texels the mixed light would be too much for the darker one's.
    sample.light = texel_at(scene, image, column, row).colour * Float(environment.intensity);
    return sample;
}

// Calls use(incidence, intensity, share) for each point of each light that lights any of the lanes; `share`
// is the point's of its light.
template <class Use>
ARHOST_INLINE void for_each_light(const Frame &frame, const Surface &s, const Random &random, Use use) {
    const Scene &scene = frame.scene;
    for (std::uint32_t i = 0; i < scene.light_count; ++i) {
        const arhost_light &light = scene.lights[i];
        const int count = is_extended(light) ? frame.light_samples : 1;
        for (int point = 0; point < count; ++point) {
            Pair where{Float(0.5f), Float(0.5f)};
            if (is_extended(light))
                where = pair(random, first_lamp_purpose + static_cast<int>(i), point, count);
            use(incidence(light, s, where), splat(light.intensity), 1 / static_cast<float>(count));
        }
    }
    if (scene.environment.image)
        for (int point = 0; point < frame.light_samples; ++point) {
            const EnvironmentSample sample =
                sample_environment(scene, s, pair(random, environment_purpose, point, frame.light_samples));
            use(sample.in, sample.light, 1 / static_cast<float>(frame.light_samples));
        }
}

// Light that surfaces other than mirrors and glass send back along the rays.
ARHOST_INLINE Vec3 direct_light(const Frame &frame, const Surface &s, Vec3 to_eye, Bool active,
                                const Random &random) {
    Vec3 sum = s.ambient * splat(frame.scene.ambient) + s.emission;
    for_each_light(frame, s, random, [&](const Incidence &in, Vec3 intensity, float share) {
        const Bool facing = active & (in.cosine > Float(0.0f)) & (in.irradiance > Float(0.0f));
        if (!any(facing))
            return;
        const Passage way = passage(frame.scene, in, s, facing);
        if (!any(way.open))
            return;
        Vec3 reflected = s.diffuse * in.cosine;
        if (s.any_specular)
            reflected = reflected +
                        select(s.is_rough, black(), s.specular * phong(s.normal, in.direction, to_eye, s.exponent));
        if (s.any_rough) {
            const Vec3 half_way = normalize(in.direction + to_eye);
            const Vec3 fresnel = schlick(s.specular, dot(to_eye, half_way));
            const Float lobe = ggx_lobe(in.cosine, dot(s.normal, to_eye), dot(s.normal, half_way), s.alpha);
            // The environment's glint comes with the ray that goes on from here.
            const Vec3 glint = in.from_environment ? black() : fresnel * lobe;
            reflected = select(s.is_rough, s.diffuse * (white() - fresnel) * in.cosine + glint, reflected);
        }
        sum = sum + reflected * way.tint * intensity * select(way.open, in.irradiance * Float(share), Float(0.0f));
    });
    return sum;
}

// What lies over the video where a catcher is: its alpha, and its colour, linear.
struct CaughtShadow {
    Float alpha;
    Vec3 colour;
};

// How much of the light that catchers would receive is hidden by virtual objects.
ARHOST_INLINE CaughtShadow caught_shadow(const Frame &frame, const RTCRayHit16 &rays, Bool active,
                                         const Random &random) {
    const Scene &scene = frame.scene;
    const Surface s = surface_at(scene, rays, active);
    Float irradiance = 0.0f, hidden_part = 0.0f, tinted_part = 0.0f;
    Vec3 weighted_colour = black(); // by channel, with coloured shadows
    for_each_light(frame, s, random, [&](const Incidence &in, Vec3 intensity, float share) {
        const Bool facing = active & (in.cosine > Float(0.0f));
        if (!any(facing))
            return;
        const Float power = intensity.x + intensity.y + intensity.z;
        const Float weight = select(facing, in.cosine * in.irradiance * power * Float(share), Float(0.0f));
        const Passage way = passage(scene, in, s, facing);
        const Bool hidden = facing & ~way.open;
        irradiance = irradiance + weight;
        hidden_part = hidden_part + select(hidden, weight, Float(0.0f));
        tinted_part = tinted_part + select(facing & way.is_tinted, weight, Float(0.0f)); // never hidden, too
        if (scene.coloured_shadows) {
            const Vec3 opaque = white() * Float(scene.shadow_alpha_opaque);
            const Vec3 through = select(way.is_tinted, opaque * (white() - way.tint), black());
            weighted_colour = weighted_colour + select(hidden, opaque, through) * weight;
        }
    });
    const Float alpha = shadow_alpha(share_of_light(hidden_part, irradiance), share_of_light(tinted_part, irradiance),
                                     Float(scene.shadow_alpha_opaque), Float(scene.shadow_alpha_translucent));
    CaughtShadow shadow{select(active, alpha, Float(0.0f)), black()};
    if (scene.coloured_shadows) {
        // Each channel's own alpha; the colour makes up for what the common one takes too much.
        const Vec3 own{share_of_light(weighted_colour.x, irradiance), share_of_light(weighted_colour.y, irradiance),
                       share_of_light(weighted_colour.z, irradiance)};
        shadow.alpha = select(active, largest(own), Float(0.0f));
        const auto colour = [&](Float channel) __attribute__((always_inline)) {
            return srgb_decode(shadow_colour_encoded(channel, shadow.alpha));
        };
        shadow.colour = {colour(own.x), colour(own.y), colour(own.z)};
    }
    return shadow;
}
