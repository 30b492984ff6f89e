// SPDX-License-Identifier: Apache-2.0
//
// Light sources of the path integrator: lamps, emissive surfaces and the environment. A light sample chooses one of
// them at random, in proportion to the light that it sends to the middle of the scene.
#pragma once
#include "path_materials.inl"
#include "path_random.inl"

// Number of light samples at a vertex of a path.
ARHOST_INLINE int source_samples(const Frame &frame, std::uint32_t depth) {
    return depth == 0 ? frame.light_samples : 1;
}

struct SourceSample {
    Vec3 to_light;  // vector from the surface to the sampled point; of unit length if the light is infinitely far
    Float t_far;    // end of the shadow ray in lengths of `to_light`
    Vec3 direction; // unit vector in the direction of `to_light`
    Vec3 light;     // irradiance at perpendicular incidence, divided by π and by the number of samples
    Float density;  // expected number of samples per steradian; 0 if scattered rays cannot hit the light source
    Bool is_virtual, is_environment;
};

ARHOST_INLINE Vec3 environment_light(const Frame &frame, Vec3 direction) {
    const Environment &environment = frame.scene.environment;
    if (!environment.image)
        return splat(frame.scene.background);
    const Vec3 d = transform(environment.environment_from_world, direction);
    return sample_texture(frame.scene.linear_of_srgb8, *environment.image, equirectangular_u(d), equirectangular_v(d))
               .colour *
           splat(environment.intensity);
}

// Expected number of samples of the environment per steradian in a direction, of one light sample.
ARHOST_INLINE Float environment_source_density(const Frame &frame, Vec3 direction) {
    const Environment &environment = frame.scene.environment;
    const Float chance = frame.path.environment_chance;
    if (!environment.image)
        return hemisphere_density() * chance;
    const Vec3 d = transform(environment.environment_from_world, direction);
    return chance * environment_density_at(environment, equirectangular_u(d), equirectangular_v(d));
}

static_assert(most_few_sources == lanes); // the table of pick()

// The random numbers of the light samples at a vertex.
struct SourcePairs {
    PathPairs source, point;
};
ARHOST_INLINE SourcePairs source_pairs(const Work &work, const Paths &paths) {
    SourcePairs pairs;
    if (work.frame.path.source_count > 1)
        pairs.source = path_pairs(work, paths, source_dimension);
    if (work.frame.path.source_count > 0)
        pairs.point = path_pairs(work, paths, light_dimension);
    return pairs;
}

// Returns light sample `index` of `count`. The samples are spread evenly over the light sources.
ARHOST_INLINE SourceSample sample_source(const Work &work, const SourcePairs &pairs, const Surface &s, int index,
                                         int count) {
    const Frame &frame = work.frame;
    const PathScene &path = frame.path;
    constexpr float before_source = 0.9999f; // shadow rays end before an emissive surface, or one that a lamp is in
    SourceSample sample{s.normal,    Float(before_source), s.normal,      black(),
                        Float(0.0f), bool_of(false),       bool_of(false)};
    if (path.source_count == 0)
        return sample;
    const Pair uv = pairs.point.pair(index, count);
    Int source(0);
    if (path.source_count > 1) {
        const Float chosen = (pairs.source.pair(index, count).u + Float(static_cast<float>(index))) *
                             Float(1.0f / static_cast<float>(count));
        source = search(path.cumulative, Int(0), path.source_count, chosen);
    }
    const Int first = source * Int(source_rows);
    const auto field = [&](int row) __attribute__((always_inline)) {
        return path.few_sources ? pick(path.few_sources + most_few_sources * row, source)
                                : gather(path.sources + row, first);
    };
    const auto vector = [&](int row) __attribute__((always_inline)) {
        return Vec3{field(row), field(row + 1), field(row + 2)};
    };
    const Int type = to_int(field(type_row));
    const Float chance = field(chance_row) * Float(static_cast<float>(count)), share = Float(1.0f) / chance;
    const Vec3 to_centre = vector(position_row) - s.position, intensity = vector(intensity_row);
    const Bool inverse_square = field(falloff_row) > Float(0.5f);
    const auto is = [&](int wanted) __attribute__((always_inline)) {
        return type == Int(wanted);
    };
    const auto emitted = [&](Float density) __attribute__((always_inline)) { // of sources of known radiance
        return intensity * (irradiance_of_density(density) * share);
    };

    if (const Bool directional = is(ARHOST_LIGHT_DIRECTIONAL); any(directional)) {
        sample.to_light = sample.direction = select(directional, -vector(direction_row), sample.to_light);
        sample.t_far = select(directional, Float(far_away), sample.t_far);
        sample.light = select(directional, intensity * share, sample.light);
    }
    const Bool spot = is(ARHOST_LIGHT_SPOT);
    if (const Bool round = is(ARHOST_LIGHT_POINT) | is(ARHOST_LIGHT_SPHERE) | spot; any(round)) {
        const Float radius = field(radius_row);
        const Bool extended = radius > Float(0.0f);
        const Vec3 to_point = select(extended, vector_to_disc(to_centre, radius, uv.u, uv.v), to_centre);
        const Vec3 direction = normalize(to_point);
        const Float squared = dot(to_point, to_point), cosine = dot(normalize(to_centre), direction);
        Float light = point_light_falloff(inverse_square, squared) * share;
        if (any(spot))
            light = select(spot,
                           light * spot_attenuation(-dot(vector(direction_row), direction), field(cosine_inner_row),
                                                    field(cosine_outer_row)),
                           light);
        sample.to_light = select(round, to_point, sample.to_light);
        sample.direction = select(round, direction, sample.direction);
        sample.light = select(round, intensity * light, sample.light);
        sample.density =
            select(round & extended, density_over_area(squared, field(area_row), cosine), sample.density);
    }
    if (const Bool rectangle = is(ARHOST_LIGHT_RECTANGLE); any(rectangle)) {
        const Vec3 to_point = vector_to_rectangle(to_centre, vector(axis_u_row), vector(axis_v_row), uv.u, uv.v);
        const Vec3 direction = normalize(to_point);
        const Float squared = dot(to_point, to_point), cosine = lambert(vector(direction_row), -direction);
        sample.to_light = select(rectangle, to_point, sample.to_light);
        sample.direction = select(rectangle, direction, sample.direction);
        sample.light = select(rectangle, intensity * (point_light_falloff(inverse_square, squared) * cosine * share),
                              sample.light);
        sample.density = select(rectangle, density_over_area(squared, field(area_row), cosine), sample.density);
    }
    if (const Bool triangle = is(triangle_source); any(triangle)) {
        const Vec3 edge_1 = vector(axis_u_row), edge_2 = vector(axis_v_row);
        const Float along = sqrt(uv.u); // uniform over the triangle
        const Vec3 to_point = to_centre + edge_1 * (along * (Float(1.0f) - uv.v)) + edge_2 * (along * uv.v);
        const Vec3 direction = normalize(to_point);
        const Float squared = dot(to_point, to_point), cosine = abs(dot(normalize(cross(edge_1, edge_2)), direction));
        const Float density = density_over_area(squared, field(area_row), cosine);
        sample.to_light = select(triangle, to_point, sample.to_light);
        sample.direction = select(triangle, direction, sample.direction);
        sample.light = select(triangle, emitted(density), sample.light);
        sample.density = select(triangle, density, sample.density);
        sample.is_virtual = triangle;
    }
    if (const Bool ball = is(ball_source); any(ball)) {
        const Float radius = field(radius_row), squared = dot(to_centre, to_centre);
        const Float sine_squared = radius * radius / max(squared, Float(1e-20f));
        const Bool outside = ball & (sine_squared < Float(0.9999f));
        const Float cosine_limit = sqrt(max(Float(1.0f) - sine_squared, Float(0.0f)));
        const Float slope = sine_squared / (Float(1.0f) + cosine_limit);
        const Vec3 direction = cone_direction(normalize(to_centre), slope, uv.u, uv.v);
        const Float along = dot(direction, to_centre),
                    half = sqrt(max(radius * radius - (squared - along * along), Float(0.0f)));
        const Float density = Float(0.159154943f) / max(slope, Float(1e-12f));
        sample.to_light = select(outside, direction * (along - half), sample.to_light);
        sample.direction = select(outside, direction, sample.direction);
        sample.light = select(outside, emitted(density), sample.light);
        sample.density = select(outside, density, sample.density);
        sample.is_virtual = sample.is_virtual | ball;
    }
    if (const Bool environment = is(environment_source); any(environment)) {
        LightSample of_environment;
        if (frame.scene.environment.image)
            of_environment = sample_environment(frame.scene, s, uv, 1);
        else
            of_environment = sample_background(frame.scene, s, uv, 1);
        sample.to_light = select(environment, of_environment.to_light, sample.to_light);
        sample.direction = select(environment, of_environment.to_light, sample.direction);
        sample.light =
            select(environment, of_environment.intensity * (of_environment.irradiance * share), sample.light);
        sample.density = select(environment, of_environment.sampling_density, sample.density);
        sample.t_far = select(environment, Float(far_away), sample.t_far);
        sample.is_environment = environment;
    }
    sample.density = sample.density * chance;
    return sample;
}

// Returns the lanes in which no object of these masks hides the light source. Light that passes through glass is not
// sampled: refracted rays and photons find it.
ARHOST_INLINE Bool is_visible(const Scene &scene, const Surface &s, const SourceSample &sample, Int masks,
                              Bool active) {
    const Vec3 above = s.lift + s.geometric_normal * s.offset;
    const Vec3 to_light = sample.to_light - select(sample.t_far < Float(far_away), above, black());
    RTCRay16 rays;
    set_ray(rays, s.position + above, to_light, sample.t_far, masks);
    return active & ~blocked(scene, rays, active);
}

// Returns the light of sampled light sources that the surfaces reflect. `scatters`: whether scattered rays follow.
ARHOST_INLINE Vec3 sampled_light(const Work &work, const Paths &paths, const Surface &s, Vec3 to_eye, bool scatters,
                                 Bool active) {
    const Scene &scene = work.frame.scene;
    const LobeChances chance = lobe_chances(s, to_eye);
    const int count = source_samples(work.frame, paths.depth);
    const SourcePairs pairs = source_pairs(work, paths);
    Vec3 sum = black();
    for (int i = 0; i < count; ++i) {
        const SourceSample sample = sample_source(work, pairs, s, i, count);
        const Bool facing =
            active & (dot(s.normal, sample.direction) > Float(0.0f)) & (largest(sample.light) > Float(0.0f));
        if (!any(facing))
            continue;
        const Bool visible = is_visible(scene, s, sample, Int(all_masks), facing);
        Float weight(1.0f);
        if (scatters)
            weight = balance_weight(sample.density, scattering_density(s, to_eye, sample.direction, chance));
        sum =
            sum + select(visible,
                         (scattering(s, to_eye, sample.direction) * weight + highlight(s, to_eye, sample.direction)) *
                             sample.light,
                         black());
    }
    return sum;
}

// Expected number of light samples per steradian, at the previous vertex of the paths, of the emissive surfaces hit.
ARHOST_INLINE Float density_of_emitter(const Work &work, const Paths &paths, const RTCRayHit16 &rays,
                                       const Surface &s, Vec3 direction, Bool active) {
    Float density(0.0f);
    for_each_object(work.frame.scene, rays.hit, active, [&](const Object &object, Bool here) {
        if (object.emitter_density <= 0)
            return;
        const Float per_source(object.emitter_density);
        if (object.ball_radius > 0) {
            const Float radius(object.ball_radius);
            const Vec3 to_centre =
                direction * s.distance + select(s.back_face, s.geometric_normal, -s.geometric_normal) * radius;
            const Float sine_squared = radius * radius / max(dot(to_centre, to_centre), Float(1e-20f));
            const Float slope = sine_squared / (Float(1.0f) + sqrt(max(Float(1.0f) - sine_squared, Float(0.0f))));
            density = select(here & (sine_squared < Float(0.9999f)),
                             per_source * Float(0.159154943f) / max(slope, Float(1e-12f)), density);
        } else {
            const Float cosine = abs(dot(s.geometric_normal, direction));
            density =
                select(here, per_source * density_over_area(s.distance * s.distance, Float(1.0f), cosine), density);
        }
    });
    return density * Float(static_cast<float>(source_samples(work.frame, paths.depth - 1)));
}

// Returns the light that rays receive from area lamps before `t_far`, where they hit a surface. Light that reaches a
// surface off mirrors and through glass is brought by photons, so rays that a surface has scattered do not count
// behind them.
ARHOST_INLINE Vec3 lamps_towards(const Work &work, const Paths &paths, Vec3 origin, Vec3 direction, Float t_far) {
    const float samples = static_cast<float>(source_samples(work.frame, paths.depth - 1));
    const Vec3 light =
        arriving_from_area_lights(work.frame, origin, direction, t_far, paths.inverse_density,
                                  [&](std::uint32_t lamp) { return samples * work.frame.path.lamp_chances[lamp]; });
    return select(paths.inverse_density < Float(0.0f), black(), light);
}

// Returns the irradiance of a real surface without virtual objects, divided by π: the irradiance map of the
// environment, and a regular grid of points on each lamp, which has fewer points if there are many lamps.
ARHOST_INLINE Vec3 irradiance_without_objects(const Frame &frame, const Surface &s) {
    const Scene &scene = frame.scene;
    Vec3 sum = splat(scene.background);
    if (scene.environment.image) {
        const Vec3 d = transform(scene.environment.environment_from_world, s.normal);
        sum = sample_texture(scene.linear_of_srgb8, frame.path.irradiance, equirectangular_u(d), equirectangular_v(d))
                  .colour *
              splat(scene.environment.intensity);
    }
    for (std::uint32_t i = 0; i < scene.light_count; ++i) {
        const arhost_light &light = scene.lights[i];
        const int side = !is_area_light(light) || scene.light_count > 64 ? 1 : scene.light_count > 8 ? 2 : 4;
        Float irradiance(0.0f);
        for (int u = 0; u < side; ++u)
            for (int v = 0; v < side; ++v) {
                const auto middle = [&](int at) __attribute__((always_inline)) {
                    return Float((static_cast<float>(at) + 0.5f) / static_cast<float>(side));
                };
                const LightSample sample = sample_light(light, s, {middle(u), middle(v)}, 1);
                irradiance = irradiance + sample.irradiance * sample.cosine;
            }
        sum = sum + splat(light.intensity) * (irradiance * Float(1.0f / static_cast<float>(side * side)));
    }
    return sum;
}
