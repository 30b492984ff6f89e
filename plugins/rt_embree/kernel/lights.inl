// SPDX-License-Identifier: Apache-2.0
//
// Direct light from lamps and the environment, and its occlusion.
#pragma once
#include "random.inl"
#include "surface.inl"

enum Purpose : int { environment_purpose = 1, glass_purpose, rough_purpose, first_lamp_purpose };

// A sampled point of a light source, relative to the surface point of each lane.
struct LightSample {
    Vec3 to_light;    // vector from the surface to the sampled point; of unit length if the light is infinitely far
    float t_far;      // end of the shadow ray in lengths of `to_light`: 1, or infinity
    Vec3 direction;   // unit vector in the direction of `to_light`
    Float cosine;     // cosine of the angle of incidence; 0 if the light is behind the surface
    Vec3 intensity;   // linear colour
    Float irradiance; // irradiance at perpendicular incidence, per unit of intensity
    // Number of samples of the light source times the density of one sample per steradian; 0 if reflected rays cannot
    // hit the light source.
    Float sampling_density;
    bool is_background; // visible in reflections only
};

ARHOST_INLINE LightSample make_light_sample(const Surface &s, Vec3 to_light, float t_far, Vec3 intensity) {
    LightSample sample;
    sample.to_light = to_light;
    sample.t_far = t_far;
    sample.direction = normalize(to_light);
    sample.cosine = lambert(s.normal, sample.direction);
    sample.intensity = intensity;
    sample.irradiance = Float(1.0f);
    sample.sampling_density = Float(0.0f);
    sample.is_background = false;
    return sample;
}

ARHOST_INLINE bool is_area_light(const arhost_light &light) {
    return light.type == ARHOST_LIGHT_RECTANGLE || light.type == ARHOST_LIGHT_SPHERE ||
           (light.type == ARHOST_LIGHT_SPOT && light.radius > 0);
}

ARHOST_INLINE Float falloff_of(const arhost_light &light, Vec3 to_light) {
    return point_light_falloff(bool_of(light.falloff == ARHOST_FALLOFF_INVERSE_SQUARE), dot(to_light, to_light));
}

// `to_light`: unit vector.
ARHOST_INLINE Float spot_share(const arhost_light &light, Vec3 to_light) {
    return spot_attenuation(dot(splat(light.direction), -to_light), Float(light.cosine_inner),
                            Float(light.cosine_outer));
}

// The irradiance of a LightSample, and the density per steradian of one sample.
struct Arriving {
    Float irradiance, density;
};
// `to_centre`, `to_point`: vectors to the centre and to a point of an area light.
ARHOST_INLINE Arriving arriving_from_point(const arhost_light &light, Vec3 to_centre, Vec3 to_point) {
    const auto squared = [](const float *a) { return a[0] * a[0] + a[1] * a[1] + a[2] * a[2]; };
    const Vec3 direction = normalize(to_point);
    const Float distance_squared = dot(to_point, to_point), falloff = falloff_of(light, to_point);
    if (light.type != ARHOST_LIGHT_RECTANGLE) {
        const float area = 3.14159265f * light.radius * light.radius;
        return {falloff, density_over_area(distance_squared, Float(area), dot(normalize(to_centre), direction))};
    }
    const float area = 4 * __builtin_sqrtf(squared(light.axis_u) * squared(light.axis_v));
    const Float cosine = lambert(splat(light.direction), -direction);
    return {falloff * cosine, density_over_area(distance_squared, Float(area), cosine)};
}

// `uv` selects the sampled point of an area light. `count`: number of samples of the area light.
ARHOST_INLINE LightSample sample_light(const arhost_light &light, const Surface &s, Pair uv, int count) {
    if (light.type == ARHOST_LIGHT_DIRECTIONAL)
        return make_light_sample(s, -splat(light.direction), far_away, splat(light.intensity));
    const Vec3 to_centre = splat(light.position) - s.position;
    LightSample sample;
    if (is_area_light(light)) {
        const Vec3 to_point =
            light.type == ARHOST_LIGHT_RECTANGLE
                ? vector_to_rectangle(to_centre, splat(light.axis_u), splat(light.axis_v), uv.u, uv.v)
                : vector_to_disc(to_centre, Float(light.radius), uv.u, uv.v);
        const Arriving arriving = arriving_from_point(light, to_centre, to_point);
        sample = make_light_sample(s, to_point, 1, splat(light.intensity));
        sample.irradiance = arriving.irradiance;
        sample.sampling_density = arriving.density * Float(static_cast<float>(count));
    } else {
        sample = make_light_sample(s, to_centre, 1, splat(light.intensity));
        sample.irradiance = falloff_of(light, to_centre);
    }
    if (light.type == ARHOST_LIGHT_SPOT)
        sample.irradiance = sample.irradiance * spot_share(light, sample.direction);
    return sample;
}

// Returns the light that secondary rays receive from area lights before `t_far`, where the rays hit a surface. Lamps
// do not hide each other or anything else. `inverse_density`: see RayQueue. After a reflection off a rough surface,
// mirrors and glass on the path are ignored in the weight, as if the lamp were seen directly. Otherwise, the few
// random rays that find a small lamp along such a path would cause bright spots.
// `samples_of(i)`: the expected number of light samples of lamp i.
template <class SamplesOf>
ARHOST_INLINE Vec3 arriving_from_area_lights(const Frame &frame, Vec3 origin, Vec3 direction, Float t_far,
                                             Float inverse_density, SamplesOf samples_of) {
    Vec3 sum = black();
    for (std::uint32_t i = 0; i < frame.scene.light_count; ++i) {
        const arhost_light &light = frame.scene.lights[i];
        if (!is_area_light(light))
            continue;
        const Vec3 to_centre = splat(light.position) - origin;
        const Float t = light.type == ARHOST_LIGHT_RECTANGLE
                            ? distance_to_rectangle(to_centre, splat(light.direction), splat(light.axis_u),
                                                    splat(light.axis_v), direction)
                            : distance_to_disc(to_centre, Float(light.radius), direction);
        const Bool arrives = (t > Float(0.0f)) & (t < t_far);
        if (!any(arrives))
            continue;
        Arriving arriving = arriving_from_point(light, to_centre, direction * t);
        if (light.type == ARHOST_LIGHT_SPOT)
            arriving.irradiance = arriving.irradiance * spot_share(light, direction);
        const Float sampled = arriving.density * Float(samples_of(i));
        const Float radiance = arriving.irradiance * arriving.density * Float(3.14159265f) *
                               balance_weight_of_ray(sampled, abs(inverse_density));
        sum = sum + splat(light.intensity) * select(arrives, radiance, Float(0.0f));
    }
    return sum;
}

// The visibility of a light source from the surface point of each lane.
struct Visibility {
    Bool unoccluded; // no opaque object is in between
    Bool is_tinted;  // glass is in between
    Vec3 tint;       // transmittance of the glass in between
};

// Returns the transmittance of the glass between `origin` and a light source. `to_light`: vector from `origin` to the
// sampled point. Sets `is_tinted` for lanes with glass in between.
ARHOST_INLINE Vec3 glass_tint(const Scene &scene, Vec3 origin, Vec3 to_light, const LightSample &sample, Bool active,
                              Bool &is_tinted) {
    constexpr int max_surfaces =
        64; // ignores further surfaces: rays may alternate endlessly between coincident faces
    Vec3 tint = white(), start = origin, remaining = to_light;
    for (int i = 0; i < max_surfaces && any(active); ++i) {
        RTCRayHit16 rays;
        set_ray(rays.ray, start, remaining, Float(sample.t_far), Int(glass_mask));
        active = trace(scene, scene.root, make_query(Coherence::incoherent), rays, active);
        if (!any(active))
            break;
        is_tinted = is_tinted | active;
        const Surface s = surface_at(scene, rays, active);
        const Float cosine = abs(dot(s.normal, sample.direction));
        const Float inside = select(s.back_face, s.distance, Float(0.0f)); // mm
        for_each_object(scene, rays.hit, active, [&](const Object &object, Bool here) {
            const arhost_material &glass = *object.material;
            tint = select(here,
                          tint * glass_shadow(splat(glass.shadow_attenuation), cosine) *
                              bouguer(splat(glass.extinction), inside),
                          tint);
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
    const Vec3 above = s.lift + s.geometric_normal * s.offset, origin = s.position + above;
    const Vec3 to_light = sample.t_far < far_away ? sample.to_light - above : sample.to_light;
    RTCRay16 rays;
    set_ray(rays, origin, to_light, Float(sample.t_far),
            select(s.is_real, Int(opaque_mask), Int(opaque_mask | catcher_mask | occluder_mask)));
    Visibility visibility;
    visibility.unoccluded = active & ~blocked(scene, rays, active);
    visibility.is_tinted = bool_of(false);
    visibility.tint = white();
    if (scene.has_glass && any(visibility.unoccluded))
        visibility.tint = glass_tint(scene, origin, to_light, sample, visibility.unoccluded, visibility.is_tinted);
    return visibility;
}

// For each lane, finds the first cumulative sum above `value` by binary search. Returns its index relative to
// `first`.
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

// Returns cumulative sum `i` − 1 (0 if i is 0), and the difference between it and cumulative sum `i`.
ARHOST_INLINE Pair step_of_sums(const float *sums, Int first, Int i) {
    const Float before =
        select(Int(0) < i, gather(sums, first + select(Int(0) < i, i - Int(1), Int(0))), Float(0.0f));
    return {before, gather(sums, first + i) - before};
}

// Returns the density per steradian of sample_environment() in a texel, computed from the steps of the cumulative
// sums.
ARHOST_INLINE Float environment_density(const Texture &image, Float row_step, Float column_step, Float v) {
    const Float texels = Float(static_cast<float>(image.width) * static_cast<float>(image.height));
    return equirectangular_density(row_step * column_step * texels, v);
}

// Returns the density per steradian of sample_environment() at the point (u, v) of the image.
ARHOST_INLINE Float environment_density_at(const Environment &environment, Float u, Float v) {
    const Texture &image = *environment.image;
    const auto texel = [](Float at, std::int32_t size) __attribute__((always_inline)) {
        return to_int(
            min(max(at * Float(static_cast<float>(size)), Float(0.0f)), Float(static_cast<float>(size - 1))));
    };
    const Int row = texel(v, image.height), first = row * Int(image.width);
    return environment_density(image, step_of_sums(environment.rows, Int(0), row).v,
                               step_of_sums(environment.columns, first, texel(u, image.width)).v, v);
}

// Returns the light that secondary rays receive from the environment or the background if they hit no surface.
// `inverse_density`: see RayQueue.
ARHOST_INLINE Vec3 arriving_from_environment(const Frame &frame, Vec3 direction, Float inverse_density) {
    inverse_density = max(inverse_density, Float(0.0f)); // samples of the environment do not follow mirrors
    const Environment &environment = frame.scene.environment;
    const bool is_random = any(inverse_density > Float(0.0f));
    Vec3 light = splat(frame.scene.background);
    Float density = hemisphere_density();
    if (environment.image) {
        const Vec3 d = transform(environment.environment_from_world, direction);
        const Float u = equirectangular_u(d), v = equirectangular_v(d);
        light = sample_texture(frame.scene.linear_of_srgb8, *environment.image, u, v).colour *
                splat(environment.intensity);
        if (is_random)
            density = environment_density_at(environment, u, v);
    }
    const Float sampled = density * Float(static_cast<float>(frame.light_samples));
    return is_random ? light * balance_weight_of_ray(sampled, inverse_density) : light;
}

// Samples a direction of the hemisphere uniformly.
ARHOST_INLINE LightSample sample_background(const Scene &scene, const Surface &s, Pair uv, int count) {
    LightSample sample =
        make_light_sample(s, hemisphere_direction(s.normal, uv.u, uv.v), far_away, splat(scene.background));
    sample.irradiance = irradiance_of_density(hemisphere_density());
    sample.sampling_density = hemisphere_density() * Float(static_cast<float>(count));
    sample.is_background = true;
    return sample;
}

// Samples a direction in proportion to the environment's luminance. `uv`: random numbers from 0 to 1.
ARHOST_INLINE LightSample sample_environment(const Scene &scene, const Surface &s, Pair uv, int count) {
    const Environment &environment = scene.environment;
    const Texture &image = *environment.image;
    const Int row = search(environment.rows, Int(0), image.height, uv.v);
    const Pair row_step = step_of_sums(environment.rows, Int(0), row);
    const Int first = row * Int(image.width);
    const Int column = search(environment.columns, first, image.width, uv.u);
    const Pair column_step = step_of_sums(environment.columns, first, column);
    const Float x = to_float(column) + fraction_of_step(uv.u, column_step.u, column_step.v);
    const Float y = to_float(row) + fraction_of_step(uv.v, row_step.u, row_step.v);
    const Float u = x * Float(1.0f / static_cast<float>(image.width)),
                v = y * Float(1.0f / static_cast<float>(image.height));
    const Vec3 d = equirectangular_direction(u, v);
    // The inverse of a rotation matrix is its transpose.
    const float *m = environment.environment_from_world;
    const Vec3 to_light{dot(splat(m), d), dot(splat(m + 3), d), dot(splat(m + 6), d)};
    const Float density = environment_density(image, row_step.v, column_step.v, v);
    const Vec3 light = sample_texture(scene.linear_of_srgb8, image, u, v).colour * splat(environment.intensity);
    LightSample sample = make_light_sample(s, to_light, far_away, light);
    sample.irradiance = irradiance_of_density(density);
    sample.sampling_density = density * Float(static_cast<float>(count));
    return sample;
}

// Calls use(light_sample, fraction) for each sample of each light source: the lamps, then the environment or, if
// `background`, the background. `fraction` is the reciprocal of the number of samples of that light source.
template <class Use>
ARHOST_INLINE void for_each_light(const Frame &frame, const Surface &s, const Random &random, bool background,
                                  Use use) {
    const Scene &scene = frame.scene;
    const bool has_environment = scene.environment.image != nullptr;
    const std::uint32_t count = scene.light_count + (has_environment || background ? 1 : 0);
    for (std::uint32_t i = 0; i < count; ++i) {
        const bool is_lamp = i < scene.light_count, has_points = !is_lamp || is_area_light(scene.lights[i]);
        const int purpose = is_lamp ? first_lamp_purpose + static_cast<int>(i) : environment_purpose;
        const int points = has_points ? frame.light_samples : 1;
        for (int point = 0; point < points; ++point) {
            Pair uv{Float(0.5f), Float(0.5f)};
            if (has_points)
                uv = pair(random, purpose, point, points);
            LightSample sample;
            if (is_lamp)
                sample = sample_light(scene.lights[i], s, uv, points);
            else if (has_environment)
                sample = sample_environment(scene, s, uv, points);
            else
                sample = sample_background(scene, s, uv, points);
            use(sample, 1 / static_cast<float>(points));
        }
    }
}

// Returns the share of a sample's light that a rough surface reflects to the eye, without the Fresnel term. A
// randomly reflected ray can reach the same light source; balance_weight() divides the light between the sample and
// that ray. Environment light that passes through glass is counted only along reflected rays, not for samples.
ARHOST_INLINE Float rough_lobe(const Surface &s, Vec3 to_eye, Vec3 half_vector, const LightSample &sample,
                               const Visibility &visibility, bool rays_follow) {
    const Float cosine_eye = dot(s.normal, to_eye), cosine_half = dot(s.normal, half_vector);
    const Float lobe = ggx_lobe(sample.cosine, cosine_eye, cosine_half, s.alpha);
    if (!rays_follow)
        return lobe;
    const Bool reflects = dot(s.geometric_normal, sample.direction) > Float(0.0f);
    const Float density = select(reflects, ggx_reflection_density(cosine_eye, cosine_half, s.alpha), Float(0.0f));
    const Bool through_glass =
        visibility.is_tinted & bool_of(sample.t_far == far_away) & (sample.sampling_density > Float(0.0f));
    return select(through_glass, Float(0.0f), lobe * balance_weight(sample.sampling_density, density));
}

// Returns the radiance that surfaces other than mirrors and glass send towards the ray's origin: ambient light,
// emission and the reflected direct light. `rays_follow`: whether rough surfaces also reflect rays.
ARHOST_INLINE Vec3 direct_light(const Frame &frame, const Surface &s, Vec3 to_eye, bool rays_follow, Bool active,
                                const Random &random) {
    Vec3 sum = s.ambient * splat(frame.scene.ambient) + s.emission;
    const bool background = s.any_rough && frame.scene.has_background;
    for_each_light(frame, s, random, background, [&](const LightSample &sample, float fraction) {
        Bool facing = active & (sample.cosine > Float(0.0f)) & (sample.irradiance > Float(0.0f));
        if (sample.is_background)
            facing = facing & s.is_rough;
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
            const Vec3 fresnel = fresnel_of(s, dot(to_eye, half_vector));
            const Vec3 diffuse = sample.is_background
                                     ? black()
                                     : s.diffuse * passing_fresnel(s, dot(to_eye, half_vector)) * sample.cosine;
            const Float lobe = rough_lobe(s, to_eye, half_vector, sample, visibility, rays_follow);
            reflected = select(s.is_rough, diffuse + fresnel * lobe, reflected);
        }
        sum = sum + reflected * visibility.tint * sample.intensity *
                        select(visibility.unoccluded, sample.irradiance * Float(fraction), Float(0.0f));
    });
    return sum;
}

// The light at a shadow catcher.
struct CatcherLight {
    Float irradiance; // irradiance without shadows
    Vec3 hidden;      // see hidden_row
};

// Computes the parts of a catcher's irradiance that virtual objects hide. Glass objects do not hide light, but tint
// it.
ARHOST_INLINE CatcherLight catcher_light(const Frame &frame, const RTCRayHit16 &rays, Bool active,
                                         const Random &random) {
    const Scene &scene = frame.scene;
    const Surface s = surface_at(scene, rays, active);
    CatcherLight light{Float(0.0f), black()};
    for_each_light(frame, s, random, false, [&](const LightSample &sample, float fraction) {
        const Bool facing = active & (sample.cosine > Float(0.0f));
        if (!any(facing))
            return;
        const Float power = sample.intensity.x + sample.intensity.y + sample.intensity.z;
        const Float weight = select(facing, sample.cosine * sample.irradiance * power * Float(fraction), Float(0.0f));
        const Visibility visibility = visibility_of(scene, sample, s, facing);
        const Bool is_hidden = facing & ~visibility.unoccluded, is_tinted = facing & visibility.is_tinted;
        light.irradiance = light.irradiance + weight;
        const Float hidden = select(is_hidden, weight, Float(0.0f)), tinted = select(is_tinted, weight, Float(0.0f));
        if (scene.coloured_shadows)
            light.hidden = light.hidden + Vec3{hidden, hidden, hidden} + (white() - visibility.tint) * tinted;
        else
            light.hidden = light.hidden + Vec3{hidden, tinted, Float(0.0f)};
    });
    return light;
}
