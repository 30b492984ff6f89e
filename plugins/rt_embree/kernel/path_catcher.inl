// SPDX-License-Identifier: Apache-2.0
//
// Real surfaces: how virtual objects change the light of catchers, and what the video shows of them.
#pragma once
#include "filmed.inl"
#include "photons.inl"

#include "raytracer_common/denoiser/history.inl"

// Returns paths whose radiance is added to another plane. The planes also have different random numbers.
ARHOST_INLINE Paths in_plane(Paths paths, Plane plane) {
    paths.pixel = (paths.pixel & Int(tile_pixels - 1)) + Int(plane * tile_pixels);
    if (paths.first_pixel >= 0)
        paths.first_pixel = (paths.first_pixel & (tile_pixels - 1)) + plane * tile_pixels;
    return paths;
}
ARHOST_INLINE Bool changes_catcher(const Paths &paths) {
    return paths.pixel >= Int(change_plane * tile_pixels);
}
ARHOST_INLINE Bool is_mirrored(const Paths &paths) {
    return paths.pixel >= Int(mirrored_plane * tile_pixels);
}

// This bit of the pixel number marks rays towards virtual objects from filmed surfaces that secondary rays hit.
constexpr int filmed_bit = plane_count * tile_pixels;
static_assert((filmed_bit & (filmed_bit - 1)) == 0);

// Returns the lanes whose rays come from a surface that the video shows: they bring light of virtual objects only.
ARHOST_INLINE Bool sees_only_virtual(const Paths &paths) {
    return paths.pixel >= Int(paths.depth == 1 ? change_plane * tile_pixels : filmed_bit);
}

// Returns whether a ray can meet a virtual object. `end`: in lengths of `to`.
ARHOST_INLINE Bool can_meet_virtual(const PathScene &path, Vec3 origin, Vec3 to, Float end) {
    const Float scale = Float(1.0f) / max(dot(to, to), Float(1e-30f));
    Bool meets = bool_of(false);
    for (std::int32_t i = 0; i < path.sphere_count; ++i) {
        const float *sphere = path.spheres + 4 * i;
        const Vec3 to_centre = splat(sphere) - origin;
        const Float nearest = min(max(dot(to_centre, to) * scale, Float(0.0f)), min(end, Float(1e18f)));
        const Vec3 miss = to_centre - to * nearest;
        meets = meets | (dot(miss, miss) < Float(sphere[3] * sphere[3]));
    }
    return meets;
}

// The directions in which a catcher may see a virtual object are sampled by the bounding spheres: uniformly in the
// cone of a sphere, or in the whole hemisphere if the sphere is close.
struct SphereCone {
    Vec3 axis;    // unit vector to the centre
    Float share;  // about the form factor of the sphere, an upper bound
    Float cosine; // of the half angle; valid unless `is_wide`
    Float slope;  // 1 − cosine
    Bool is_wide;
};
ARHOST_INLINE SphereCone cone_of(const float *sphere, const Surface &s) {
    const Vec3 to_centre = splat(sphere) - s.position;
    const Float squared = max(dot(to_centre, to_centre), Float(1e-20f));
    const Float sine_squared = min(Float(sphere[3] * sphere[3]) / squared, Float(1.0f));
    const Vec3 axis = to_centre * (Float(1.0f) / sqrt(squared));
    const Float cosine = sqrt(max(Float(1.0f) - sine_squared, Float(0.0f)));
    const Float height = min(max(dot(axis, s.normal) + sqrt(sine_squared), Float(0.0f)), Float(1.0f));
    return {axis, sine_squared * height, cosine, sine_squared / (Float(1.0f) + cosine), sine_squared > Float(0.5f)};
}

struct Bounce {
    Vec3 direction;
    Float density; // expected number of rays per steradian; 0: no ray
};

// Density per steradian of sample_virtual() in a direction, before the roulette.
ARHOST_INLINE Float virtual_density(const PathScene &path, const Surface &s, Vec3 direction, Float total) {
    Float density(0.0f);
    const Float by_cosine = max(dot(direction, s.normal), Float(0.0f)) * Float(0.318309886f);
    for (std::int32_t i = 0; i < path.sphere_count; ++i) {
        const SphereCone cone = cone_of(path.spheres + 4 * i, s);
        const Bool inside = dot(direction, cone.axis) >= cone.cosine;
        const Float in_cone = select(inside, Float(0.159154943f) / max(cone.slope, Float(1e-12f)), Float(0.0f));
        density = density + cone.share * select(cone.is_wide, by_cosine, in_cone);
    }
    return density / max(total, Float(1e-20f));
}

// Objects whose form factors have a smaller sum reflect no light to a catcher, so that they do not affect the whole
// desk.
constexpr float least_form_factor = 1.0f / 512;

// Chance of a ray from a catcher towards the virtual objects, from the sum of their form factors.
ARHOST_INLINE Float bounce_chance(Float form_factors) {
    return select(form_factors < Float(least_form_factor), Float(0.0f),
                  min(max(form_factors * Float(3.0f), Float(0.02f)), Float(1.0f)));
}

ARHOST_INLINE Float form_factors_of(const PathScene &path, const Surface &s) {
    Float total(0.0f);
    for (std::int32_t i = 0; i < path.sphere_count; ++i)
        total = total + cone_of(path.spheres + 4 * i, s).share;
    return total;
}

ARHOST_INLINE Bounce sample_virtual(const Work &work, const Paths &paths, const Surface &s, Float total) {
    const PathScene &path = work.frame.path;
    const Float chance = bounce_chance(total);
    const Pair choice = path_pair(work, paths, choice_dimension);
    const Bool active = choice.u < chance;
    if (!any(active))
        return {s.normal, Float(0.0f)};
    const Pair uv = path_pair(work, paths, scatter_dimension);
    Vec3 direction = cosine_direction(s.normal, uv.u, uv.v);
    Float remaining = choice.v * total;
    Bool searching = active;
    for (std::int32_t i = 0; i < path.sphere_count; ++i) {
        const SphereCone cone = cone_of(path.spheres + 4 * i, s);
        const Bool here = searching & (remaining < cone.share) & ~cone.is_wide;
        searching = searching & (remaining >= cone.share);
        remaining = remaining - cone.share;
        if (any(here))
            direction = select(here, cone_direction(cone.axis, cone.slope, uv.u, uv.v), direction);
    }
    const Float density = virtual_density(path, s, direction, total) * chance;
    return {direction, select(active & (dot(direction, s.geometric_normal) > Float(0.0f)) &
                                  (dot(direction, s.normal) > Float(0.0f)),
                              density, Float(0.0f))};
}

// Returns the lanes whose gloss mirrors about 1/256 of the virtual objects' radiance or more: the reflectance, times
// the share of the reflected rays that meet the bounding spheres, if all were as dense as the densest.
ARHOST_INLINE Bool mirrors_virtual(const PathScene &path, const Surface &s, Vec3 to_eye) {
    const Vec3 middle = mirror_direction(-to_eye, s.normal);
    Float share(0.0f);
    for (std::int32_t i = 0; i < path.sphere_count; ++i) {
        const SphereCone cone = cone_of(path.spheres + 4 * i, s);
        const Float along = dot(middle, cone.axis);
        const Vec3 across = middle - cone.axis * along;
        const Float sine = sqrt(max(Float(1.0f) - cone.cosine * cone.cosine, Float(0.0f)));
        const Vec3 edge = cone.axis * cone.cosine + across * (sine / max(length(across), Float(1e-6f)));
        const Vec3 densest = select(cone.is_wide | (along >= cone.cosine), middle, edge); // direction in the cone
        const Float density =
            ggx_reflection_density(dot(s.normal, to_eye), dot(s.normal, normalize(densest + to_eye)), s.alpha);
        share = share + min(density * cone.slope * Float(6.28318531f), Float(1.0f));
    }
    return s.is_rough & (largest(fresnel_of(s, dot(s.normal, to_eye))) * share >= Float(1.0f / 256));
}

// Returns the lanes in which virtual objects hide a lamp's or the environment's sample from a real surface.
ARHOST_INLINE Bool is_hidden(const Work &work, const Surface &s, const SourceSample &sample, Bool active) {
    active = active & can_meet_virtual(work.frame.path, s.position, sample.to_light, sample.t_far);
    return any(active) ? active & ~is_visible(work.frame.scene, s, sample, Int(virtual_masks), active) : active;
}

// Returns the lanes in which the first object towards the sampled light is virtual.
ARHOST_INLINE Bool is_virtual_first(const Scene &scene, const Surface &s, const SourceSample &sample, Bool active) {
    RTCRayHit16 rays;
    set_ray(rays.ray, s.position + s.lift + s.geometric_normal * s.offset, sample.to_light, sample.t_far,
            Int(all_masks));
    const Bool hit = trace(scene, scene.root, make_query(Coherence::incoherent), rays, active);
    Bool first = bool_of(false);
    for_each_object(scene, rays.hit, hit, [&](const Object &object, Bool here) {
        if (object.role == ARHOST_ROLE_VIRTUAL)
            first = first | here;
    });
    return first;
}

// Returns the share of a real surface's light that virtual objects can shadow: 1 for dielectrics, unless they are
// black. Metals only mirror.
ARHOST_INLINE Float shadowed_share(const Surface &s) {
    constexpr float dielectric_reflectance = 0.04f;
    const Float diffuse = luminance(s.diffuse),
                metallic = max(luminance(s.specular) - Float(dielectric_reflectance), Float(1e-6f));
    return select(s.is_rough, diffuse / (diffuse + metallic), Float(1.0f));
}

// Returns the irradiance that photons bring, divided by π.
ARHOST_INLINE Vec3 photon_irradiance(const Work &work, const Paths &paths, const Surface &s, Bool active) {
    return photon_light(work, paths, s, active, [](Vec3 power, Vec3) { return PhotonLight{power, black()}; }).light;
}

// Returns how virtual objects change the irradiance of real surfaces, divided by π, by light samples: minus the light
// that they hide, plus that of emissive ones. Calls use(sample, lanes) for each sample that they change and that no
// real object hides.
template <class Use>
ARHOST_INLINE Vec3 sampled_change(const Work &work, const Paths &paths, const Surface &s, Float form_factors,
                                  int count, Bool active, Use use) {
    const Frame &frame = work.frame;
    const bool bounces = paths.depth < frame.scene.max_depth,
               may_be_hidden = frame.scene.has_several_real || frame.scene.has_gloss;
    const SourcePairs pairs = source_pairs(work, paths);
    Vec3 change = black();
    for (int i = 0; i < count; ++i) {
        const SourceSample sample = sample_source(work, pairs, s, i, count);
        const Float cosine = lambert(s.normal, sample.direction);
        const Bool facing = active & (cosine > Float(0.0f)) & (largest(sample.light) > Float(0.0f));
        const Bool real = facing & ~sample.is_virtual, emitter = facing & sample.is_virtual;
        Bool changed = bool_of(false);
        if (any(real)) {
            const Bool hidden = is_hidden(work, s, sample, real);
            changed = hidden;
            if (may_be_hidden && any(hidden))
                changed = is_visible(frame.scene, s, sample, Int(real_masks), hidden);
            // In front of a lamp, real objects already cast a shadow in the video. The environment shows them, too,
            // so that virtual objects before them hide its light.
            Bool darkened = changed;
            if (const Bool unclear = hidden & ~changed & sample.is_environment; any(unclear))
                darkened = darkened | is_virtual_first(frame.scene, s, sample, unclear);
            change = change - select(darkened, sample.light * cosine, black());
        }
        if (any(emitter)) {
            const Bool visible = is_visible(frame.scene, s, sample, Int(all_masks), emitter);
            Float weight(1.0f);
            if (bounces)
                weight =
                    balance_weight(sample.density, virtual_density(frame.path, s, sample.direction, form_factors) *
                                                       bounce_chance(form_factors));
            change = change + select(visible, sample.light * (cosine * weight), black());
            changed = changed | visible;
        }
        use(sample, changed);
    }
    return change;
}

// Queues rays from real surfaces towards virtual objects. `throughput`: of the irradiance, divided by π.
// `sample_ratio`: the number of the surface's light samples, divided by that of a surface of this depth.
ARHOST_INLINE void enqueue_bounce(Work &work, const Paths &paths, const Surface &s, Float form_factors,
                                  Vec3 throughput, float sample_ratio, Bool active) {
    if (paths.depth >= work.frame.scene.max_depth)
        return;
    const Bounce bounce = sample_virtual(work, paths, s, form_factors);
    active = active & (bounce.density > Float(0.0f)) & (largest(throughput) > Float(0.0f));
    if (!any(active))
        return;
    const Float cosine = dot(bounce.direction, s.normal);
    Paths from = paths;
    if (paths.depth > 0)
        from.pixel = from.pixel | Int(filmed_bit);
    enqueue(work, from, s.position + s.geometric_normal * s.offset, bounce.direction,
            throughput * (cosine * Float(0.318309886f) / max(bounce.density, Float(1e-20f))), active,
            Float(sample_ratio) / max(bounce.density, Float(1e-30f)));
}

// Returns the ratio of the relative change of a real surface's light to the change of its irradiance. `irradiance`:
// without virtual objects.
ARHOST_INLINE Vec3 relative_change(const Frame &frame, const Surface &s, Vec3 irradiance) {
    const float least = frame.path.least_irradiance;
    const Float share = s.any_rough ? shadowed_share(s) : Float(1.0f);
    const auto ratio = [&](Float a) __attribute__((always_inline)) {
        return least > 0 ? share / max(a, Float(least)) : Float(0.0f);
    };
    return {ratio(irradiance.x), ratio(irradiance.y), ratio(irradiance.z)};
}

// Returns whether an image shows a part of the change of a catcher's light.
ARHOST_INLINE bool shows(const Frame &frame, View part) {
    const bool is_part = frame.view == View::shadow || frame.view == View::bounce || frame.view == View::caustics;
    return !is_part || frame.view == part;
}

// Adds the change of a catcher's light, relative to its light without virtual objects. Of its gloss, adds the light
// that virtual objects add and remove in absolute terms.
ARHOST_FUNCTION void change_catcher(Work &work, const Paths &paths, const RTCRayHit16 &rays, const Bool &active) {
    const Frame &frame = work.frame;
    const Surface s = surface_at(frame.scene, rays, active);
    const Vec3 before = irradiance_without_objects(frame, s);
    Paths relative = paths;
    relative.throughput = relative_change(frame, s, before);
    const Bool glossy = active & s.is_rough;
    const bool any_glossy = s.any_rough && any(glossy);
    const Vec3 to_eye = -normalize(direction_of(rays.ray));
    Bool mirrors = bool_of(false);
    if (frame.scene.max_depth > 0 && any_glossy)
        mirrors = glossy & mirrors_virtual(frame.path, s, to_eye);
    const Float form_factors = form_factors_of(frame.path, s);
    Vec3 mirrored = black(), covered = black();
    const auto add_to_gloss = [&](const SourceSample &sample, Bool of) __attribute__((always_inline)) {
        of = of & glossy;
        if (!any_glossy || !any(of))
            return;
        const Float density = scattering_density(s, to_eye, sample.direction, Float(1.0f));
        const Float weight = balance_weight(sample.density, select(mirrors, density, Float(0.0f)));
        const Vec3 light = gloss(s, to_eye, sample.direction) * sample.light * weight;
        mirrored = mirrored + select(of & sample.is_virtual, light, black());
        covered = covered + select(of & ~sample.is_virtual, light, black());
    };
    Vec3 change = black();
    if (shows(frame, View::shadow))
        change = sampled_change(work, paths, s, form_factors, frame.light_samples, active, add_to_gloss);
    // Rays of the gloss do not see lamps behind mirrors and glass.
    const PhotonLight by_photons = photon_light(
        work, paths, s, active & bool_of(shows(frame, View::caustics)),
        [&](Vec3 power, Vec3 to_light) __attribute__((always_inline)) {
            PhotonLight light{power, black()};
            if (any_glossy)
                light.mirrored =
                    power * gloss(s, to_eye, to_light) * (Float(1.0f) / max(dot(s.normal, to_light), Float(0.01f)));
            return light;
        });
    add_radiance(work, relative, change + by_photons.light, active);
    const Paths of_gloss = in_plane(paths, mirrored_plane);
    if (any_glossy) {
        add_radiance(work, of_gloss, mirrored + by_photons.mirrored, glossy);
        add_radiance(work, in_plane(paths, covered_plane), covered, glossy);
        const Vec3 matt = s.diffuse * passing_fresnel(s, dot(s.normal, to_eye)) * before;
        const int first = paths.first_pixel & (tile_pixels - 1);
        add_to_sum(work.scratch, matt_row, first, select(glossy, matt.x, Float(0.0f)));
        add_to_sum(work.scratch, matt_row + 1, first, select(glossy, matt.y, Float(0.0f)));
        add_to_sum(work.scratch, matt_row + 2, first, select(glossy, matt.z, Float(0.0f)));
    }
    if (any(mirrors)) {
        const RoughReflection ray = sample_rough(s, to_eye, path_pair(work, of_gloss, scatter_dimension));
        enqueue(work, of_gloss, s, ray,
                mirrors & can_meet_virtual(frame.path, s.position, ray.direction, Float(far_away)));
    }
    if (shows(frame, View::bounce))
        enqueue_bounce(work, relative, s, form_factors, relative.throughput, 1, active);
}

struct FilmedLight {
    Vec3 light; // of the video
    Bool added;
};

// The change of the light of catchers, relative to their light without virtual objects.
struct KnownChange {
    Bool known;
    Vec3 change;
};
// Returns what the denoiser knows from earlier frames of catchers that were in the picture, so that paths which
// arrive there need not go on.
ARHOST_INLINE KnownChange known_change(const Frame &frame, const RTCHit16 &hit, const Surface &s, Bool active) {
    constexpr float least_frames = 8; // means of fewer frames have more noise than new samples in each frame
    KnownChange past{bool_of(false), black()};
    const bool is_whole = shows(frame, View::shadow) && shows(frame, View::bounce);
    if (!frame.denoising || !frame.denoising->catchers.before[0] || !is_whole)
        return past;
    const Denoising &denoising = *frame.denoising;
    const Layer &layer = denoising.catchers;
    const Int surface = surface_number(object_number(frame.scene, hit), Int(real_surface));
    const PastPoints before = points_before(denoising, s.position, s.normal, surface, active);
    const Projected at = projected(denoising, denoising.camera_before, before.position);
    const float side = static_cast<float>(layer.cell_px);
    const auto cell_of = [&](Float px) __attribute__((always_inline)) {
        return (px + Float(0.5f)) * Float(1 / side) - Float(0.5f);
    };
    Float frames(0.0f), total(0.0f);
    for_each_past_cell(
        layer, cell_of(at.x), cell_of(at.y), at.distance, before.normal, surface,
        active & at.inside, [&](Int cell, Float share, Bool here) __attribute__((always_inline)) {
            const auto value = [&](int row) __attribute__((always_inline)) {
                return select(here, gather(layer.before[row], cell), Float(0.0f)) * share;
            };
            past.change = past.change + Vec3{value(0), value(1), value(2)};
            frames = frames + value(frames_history);
            total = total + share;
        });
    past.known = (total > Float(0.5f)) & (frames >= total * Float(least_frames));
    past.change = past.change * (Float(1.0f) / max(total, Float(1e-6f)));
    return past;
}

// Adds the light of real surfaces that the video shows, as virtual objects change it.
ARHOST_INLINE FilmedLight add_filmed(Work &work, const RTCHit16 &hit, const Surface &s, const Paths &paths,
                                     Bool active) {
    const Frame &frame = work.frame;
    const Filmed filmed = filmed_surface(frame, hit, s, active);
    active = filmed.inside;
    if (!any(active))
        return {filmed.light, active};
    const Vec3 relative = relative_change(frame, s, irradiance_without_objects(frame, s));
    const Vec3 reflectance = filmed.light * relative;
    // If the described light is weaker than that of the video, the surface must not reflect more than it receives.
    // The known change does not tell to how much of it this applies.
    const Vec3 albedo{min(reflectance.x, Float(1.0f)), min(reflectance.y, Float(1.0f)),
                      min(reflectance.z, Float(1.0f))};
    const KnownChange past = known_change(frame, hit, s, active & (Float(1.0f) >= largest(reflectance)));
    add_radiance(work, paths, filmed.light * (white() + past.change), past.known);
    const Bool unknown = active & ~past.known;
    if (!any(unknown))
        return {filmed.light, active};
    const Float form_factors = form_factors_of(frame.path, s);
    // The eye sees these surfaces in mirrors and glass, so they get as many light samples as those that it sees
    // directly.
    const int count = source_samples(frame, paths.depth - 1);
    const Vec3 change =
        sampled_change(work, paths, s, form_factors, count, unknown, [](const SourceSample &, Bool) {}) +
        photon_irradiance(work, paths, s, unknown);
    add_radiance(work, paths, filmed.light * (white() + change * relative), unknown);
    const float sample_ratio = static_cast<float>(count) / static_cast<float>(source_samples(frame, paths.depth));
    enqueue_bounce(work, paths, s, form_factors, paths.throughput * albedo, sample_ratio, unknown);
    return {filmed.light, active};
}

// Returns the light that rays receive that hit no surface: the environment or the background. Rays that only mirrors
// and glass have scattered see the video where it shows the environment, which is nearer than infinity there.
ARHOST_INLINE Vec3 environment_towards(const Work &work, const Paths &paths, Vec3 direction, Bool active) {
    const Frame &frame = work.frame;
    Vec3 light = environment_light(frame, direction);
    const Bool is_specular = active & (paths.inverse_density == Float(0.0f)) & ~changes_catcher(paths);
    if (frame.path.video.image.texels && any(is_specular)) {
        const Filmed filmed = filmed_towards(frame, direction);
        Bool seen = is_specular & filmed.inside;
        if (any(seen)) {
            RTCRay16 ray;
            set_ray(ray, splat(frame.camera.eye), direction, Float(far_away), Int(real_masks));
            seen = seen & ~blocked(frame.scene, ray, seen);
            const Bool saturated = largest(filmed.light) >= Float(saturated_video); // the light may be brighter
            const Vec3 brighter{max(light.x, filmed.light.x), max(light.y, filmed.light.y),
                                max(light.z, filmed.light.z)};
            light = select(seen, select(saturated, brighter, filmed.light), light);
        }
        if (const Bool unseen = is_specular & ~filmed.inside; frame.surroundings && any(unseen)) {
            const Remembered remembered = remembered_towards(*frame.surroundings, direction, unseen);
            light = light + (remembered.light - light) * remembered.certainty;
        }
    }
    const Bool weighted = paths.inverse_density > Float(0.0f); // light samples do not follow mirrors and glass
    if (!any(active & weighted))
        return light;
    const Float density = environment_source_density(frame, direction) *
                          Float(static_cast<float>(source_samples(frame, paths.depth - 1)));
    return light * select(weighted, balance_weight_of_ray(density, paths.inverse_density), Float(1.0f));
}

// Adds the light that glossy catchers mirror without virtual objects, along rays that meet virtual objects: that of a
// real surface, or of the environment and of lamps.
ARHOST_INLINE void add_covered(Work &work, const Paths &paths, const RTCRay16 &ray, Bool active) {
    const Frame &frame = work.frame;
    const Vec3 origin = origin_of(ray), direction = direction_of(ray);
    RTCRayHit16 behind;
    set_ray(behind.ray, origin, direction, Float(far_away), Int(real_masks));
    const Bool hit = trace(frame.scene, frame.scene.root, make_query(Coherence::incoherent), behind, active);
    Vec3 light = environment_towards(work, paths, direction, active & ~hit);
    if (any(hit)) {
        const Surface s = surface_at(frame.scene, behind, hit);
        const Filmed filmed = filmed_surface(frame, behind.hit, s, hit);
        light = select(
            hit, select(filmed.inside, filmed.light, s.emission + s.diffuse * irradiance_without_objects(frame, s)),
            light);
    }
    if (frame.scene.has_area_lights) // except those before the virtual object
        light = light + lamps_towards(work, paths, origin, direction, load(behind.ray.tfar)) -
                lamps_towards(work, paths, origin, direction, load(ray.tfar));
    add_radiance(work, in_plane(paths, covered_plane), light, active);
}
