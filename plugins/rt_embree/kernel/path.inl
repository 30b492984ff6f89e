// SPDX-License-Identifier: Apache-2.0
//
// The path integrator: next-event estimation, scattered rays, and multiple importance sampling of both (Veach, Robust
// Monte Carlo Methods for Light Transport Simulation, 1997). A path that starts at a virtual object collects
// radiance; one that starts at a catcher collects the change of its diffuse light, relative to that without virtual
// objects, or the change of the light that it mirrors (Debevec, Rendering Synthetic Objects into Real Scenes,
// SIGGRAPH 1998; residual path integrals, arXiv 2406.16302).
#pragma once
#include "guides.inl"
#include "photons.inl"

// Paths of fewer bounces are not ended at random.
constexpr std::uint32_t first_roulette_depth = 2;

// Returns the paths from the eye that only mirrors and glass have scattered, and no random choice.
ARHOST_INLINE Bool is_seen(const Paths &paths) {
    return (bits_of(paths.inverse_density) == Int(0)) & ~changes_catcher(paths);
}

// The inverse density of paths that only mirrors and glass have scattered, but also random choices: −0.
ARHOST_INLINE Paths unseen_where(Paths paths, Bool random) {
    const Int bits = bits_of(paths.inverse_density);
    paths.inverse_density = float_of(select(random & (bits == Int(0)), Int(INT32_MIN), bits));
    return paths;
}

// Ends paths at random, so that those that go on have about the same throughput, 1 / importance. `random`: 0 to 1.
// Returns the lanes that go on; in these, updates `paths` and `throughput`.
ARHOST_INLINE Bool survive(Paths &paths, Vec3 &throughput, Float importance, Float random, Bool active) {
    active = active & (largest(throughput) > Float(0.0f));
    if (paths.depth < first_roulette_depth || !any(active))
        return active;
    const Float chance = min(max(largest(throughput) * importance, Float(0.05f)), Float(1.0f));
    throughput = throughput * (Float(1.0f) / chance);
    paths = unseen_where(paths, chance < Float(1.0f));
    return active & (random < chance);
}

// Light that is seen in mirrors and through glass should have no noise (Scratch::seen).
ARHOST_INLINE Float importance_of(const Work &work, const Paths &paths) {
    constexpr float of_seen = 16;
    return select(is_seen(paths) & bool_of(work.frame.denoising), Float(of_seen), Float(1.0f));
}

// Queues a reflected or a refracted ray, chosen at random; both at the first hit, which the eye sees most clearly,
// and for the denoiser where glass is seen. `choice`: 0 to 1; `roulette`: see survive().
ARHOST_INLINE void scatter_path_in_glass(Work &work, const Paths &from, const Surface &s, Vec3 direction,
                                         const Glass &material, Float choice, Pair roulette, Bool active) {
    const Pair uv = material.is_rough ? path_pair(work, from, facet_dimension) : Pair{};
    const Paths paths = unseen_where(from, bool_of(material.is_rough));
    const GlassScatter glass = scatter_at_glass(s, direction, material, uv, active);
    const Vec3 arriving = paths.throughput * glass.transmittance;
    const Float importance = importance_of(work, paths);
    const Bool both = bool_of(from.depth == 0) | (importance > Float(1.0f)), reflects = choice < glass.reflectance;
    const auto follow = [&](Bool chosen, Vec3 origin, Vec3 towards, Vec3 throughput, Float share, Float random)
        __attribute__((always_inline)) {
        Paths next = paths;
        throughput = throughput * select(both, share, Float(1.0f));
        if (const Bool goes_on = survive(next, throughput, importance, random, active & (both | chosen));
            any(goes_on))
            enqueue(work, next, origin, towards, throughput, goes_on);
    };
    follow(reflects, s.position + s.geometric_normal * s.offset, glass.reflected,
           arriving * material.reflection * glass.unmasked_reflected, glass.reflectance, roulette.u);
    follow(~reflects, s.position - s.geometric_normal * s.offset, glass.refracted,
           arriving * material.refraction * glass.unmasked_refracted, Float(1.0f) - glass.reflectance,
           select(both, roulette.v, roulette.u));
}

// Queues one ray for each lane, scattered by the surface.
ARHOST_INLINE void scatter_path(Work &work, const Paths &paths, const RTCRayHit16 &rays, const Surface &s,
                                Vec3 direction, Bool active) {
    const Vec3 to_eye = -direction;
    const Pair choice = path_pair(work, paths, choice_dimension),
               roulette = paths.depth < first_roulette_depth ? Pair{} : path_pair(work, paths, roulette_dimension);
    Float mirror_chance(0.0f);
    Vec3 mirror_reflectance = black();
    Bool opaque = active;
    for_each_object(work.frame.scene, rays.hit, active, [&](const Object &object, Bool here) {
        const arhost_material &material = *object.material;
        if (material.model == ARHOST_MATERIAL_GLASS) {
            scatter_path_in_glass(work, paths, s, direction, glass_of(material, s), choice.v, roulette, here);
            opaque = opaque & ~here;
        } else if (material.model == ARHOST_MATERIAL_METALLIC_ROUGHNESS && material.transmission > 0) {
            const Bool transmits = here & (choice.v < s.transmission);
            if (!any(transmits))
                return;
            scatter_path_in_glass(work, unseen_where(paths, s.transmission < Float(1.0f)), s, direction,
                                  glass_of(material, s), choice.v / max(s.transmission, Float(1e-6f)), roulette,
                                  transmits);
            opaque = opaque & ~transmits;
        } else if (material.model == ARHOST_MATERIAL_MIRROR) {
            mirror_reflectance = select(here, splat(material.reflectivity), mirror_reflectance);
            mirror_chance = select(here, Float(1.0f), mirror_chance);
        } else if (material.model == ARHOST_MATERIAL_METAL) {
            const Vec3 reflectance = schlick(splat(material.reflectivity), -dot(direction, s.normal));
            mirror_reflectance = select(here, reflectance, mirror_reflectance);
            mirror_chance = select(here, metal_mirror_chance(reflectance, s.diffuse), mirror_chance);
        }
    });
    if (!any(opaque))
        return;
    const Bool mirrors = opaque & (choice.v < mirror_chance);
    Vec3 by_mirror = paths.throughput * mirror_reflectance * (Float(1.0f) / max(mirror_chance, Float(1e-6f)));
    Paths mirrored = unseen_where(paths, mirror_chance < Float(1.0f));
    if (const Bool goes_on = survive(mirrored, by_mirror, importance_of(work, mirrored), roulette.u, mirrors);
        any(goes_on))
        enqueue(work, mirrored, s.position + s.geometric_normal * s.offset, reflected(s, direction), by_mirror,
                goes_on);
    Bool scatters = opaque & ~mirrors & s.is_lit;
    if (!any(scatters))
        return;
    const LobeChances chance = lobe_chances(s, to_eye);
    const Float below = Float(1.0f) - chance.coat;
    const Bool specular = choice.u < chance.specular * below;
    const Pair uv = path_pair(work, paths, scatter_dimension);
    Vec3 out = cosine_direction(s.normal, uv.u, uv.v);
    if (s.any_rough && any(specular & scatters))
        out = select(specular, mirror_direction(direction, half_vector_of(s, to_eye, uv)), out);
    if (const Bool by_coat = choice.u >= below; s.any_coat && any(by_coat & scatters))
        out = select(by_coat,
                     mirror_direction(direction, ggx_half_vector(s.coat_normal, to_eye, s.coat_alpha, uv.u, uv.v)),
                     out);
    const Float cosine = dot(out, s.normal);
    const Float density = scattering_density(s, to_eye, out, chance);
    Vec3 throughput = paths.throughput * scattering(s, to_eye, out) *
                      (Float(0.318309886f) / max(density * (Float(1.0f) - mirror_chance), Float(1e-20f)));
    scatters =
        scatters & (cosine > Float(0.0f)) & (dot(out, s.geometric_normal) > Float(0.0f)) & (density > Float(0.0f));
    Paths next = paths;
    scatters = survive(next, throughput, Float(1.0f), roulette.u, scatters);
    if (any(scatters))
        enqueue(work, paths, s.position + s.geometric_normal * s.offset, out, throughput, scatters,
                Float(1.0f) / max(density, Float(1e-30f)));
}

// Queues what the eye sees through surfaces in proportion to 1 − their opacity, and reduces the throughput of `paths`
// to their opacity. Rays that do not come from the eye pass such surfaces at random (HitFilter).
ARHOST_INLINE void pass_translucent(Work &work, Paths &paths, const Surface &s, Vec3 direction, Bool active) {
    active = active & is_seen(paths) & (s.opacity < Float(1.0f));
    if (!any(active))
        return;
    const Vec3 passing = paths.throughput * (Float(1.0f) - s.opacity);
    const Bool goes_on = active & (largest(passing) > Float(min_throughput));
    if (paths.depth < work.frame.scene.max_depth && any(goes_on))
        enqueue(work, paths, s.position - s.geometric_normal * s.offset, direction, passing, goes_on);
    paths.throughput = paths.throughput * select(active, s.opacity, Float(1.0f));
}

// Adds the light of surfaces behind mirrors, glass and translucent surfaces to Scratch::seen. `is_translucent`: the
// surface, which adds its own part.
ARHOST_FUNCTION void add_seen(Work &work, const Paths &paths, Vec3 light, Bool active,
                              Bool is_translucent = bool_of(false)) {
    if (!work.frame.denoising)
        return;
    active = active & is_seen(paths);
    if (paths.depth == 0)
        active = active & is_translucent;
    if (!any(active))
        return;
    const Vec3 arriving = paths.throughput * light;
    const auto bounded = [&](Float value) __attribute__((always_inline)) { // as accumulate_path()
        return select(value < Float(1e30f), min(value, Float(work.frame.path.max_radiance)), Float(0.0f));
    };
    add_to_pixels(work.scratch.seen, paths.pixel, {bounded(arriving.x), bounded(arriving.y), bounded(arriving.z)},
                  active);
}

// The denoiser leaves bright single paths visible for many frames. So surfaces have wider highlights where another
// surface, but a mirror or glass, scatters their light (A. Kaplanyan and C. Dachsbacher, Path Space Regularization
// for Holistic and Robust Light Transport, Eurographics 2013).
constexpr float least_scattered_alpha = 0.3f;

// Adds the light that the hit surfaces send towards the rays' origins, and queues the rays that they scatter.
ARHOST_FUNCTION void shade_path(Work &work, const RTCRayHit16 &rays, const Bool &hit, const Paths &from) {
    const Scene &scene = work.frame.scene;
    Bool active = hit;
    Paths paths = from;
    Surface s = surface_at(scene, rays, active);
    if (work.frame.denoising && s.any_rough) {
        s.alpha = select((paths.inverse_density == Float(0.0f)) | (s.transmission > Float(0.0f)), s.alpha,
                         max(s.alpha, Float(least_scattered_alpha)));
        s.tangent_alpha = max(s.tangent_alpha, s.alpha);
    }
    const Vec3 direction = normalize(direction_of(rays.ray));
    if (s.any_rough)
        bend_normals(s, -direction);
    if (paths.depth > 0)
        active = active & ~(s.is_real & sees_only_virtual(paths));
    paths.pixel = paths.pixel & Int(filmed_bit - 1);
    if (paths.depth > 0 && any(active & s.is_real)) {
        const FilmedLight filmed = add_filmed(work, rays.hit, s, paths, active & s.is_real);
        add_seen(work, paths, filmed.light, filmed.added);
        active = active & ~filmed.added;
    }
    if (!any(active))
        return;
    if (s.any_translucent)
        pass_translucent(work, paths, s, direction, active);
    if (paths.depth == 1)
        if (const Bool mirrored = active & is_mirrored(paths); any(mirrored))
            add_covered(work, paths, rays.ray, mirrored);
    const Bool emits = active & (largest(s.emission) > Float(0.0f));
    if (any(emits)) {
        const Float inverse_density =
            max(paths.inverse_density, Float(0.0f)); // behind mirrors and glass: full weight
        Vec3 emission = s.emission;
        if (paths.depth > 0)
            emission = emission * balance_weight_of_ray(density_of_emitter(work, paths, rays, s, direction, emits),
                                                        inverse_density);
        add_radiance(work, paths, emission, emits);
    }
    const Float lit_share = Float(1.0f) - s.transmission;
    add_seen(work, paths, select(emits, s.emission, divisor_of(s) * lit_share), active & (emits | s.is_lit),
             (s.opacity < Float(1.0f)) | (s.transmission > Float(0.0f)));
    const bool scatters = paths.depth < scene.max_depth;
    const Bool lit = active & s.is_lit & (s.transmission < Float(1.0f));
    if (any(lit)) {
        const PhotonLight by_photons = photon_light(
            work, paths, s, lit, [&](Vec3 power, Vec3 to_light) __attribute__((always_inline)) {
                const Vec3 scattered = scattering(s, -direction, to_light) + highlight(s, -direction, to_light);
                return PhotonLight{power * scattered * (Float(1.0f) / max(dot(s.normal, to_light), Float(0.01f))),
                                   black()};
            });
        const Vec3 light = by_photons.light + sampled_light(work, paths, s, -direction, scatters, lit);
        add_radiance(work, paths, light * lit_share, lit);
    }
    if (scatters)
        scatter_path(work, paths, rays, s, direction, active);
}

// Removes the newest rays, at most 16, from the queue of `depth`, traces them and shades their hits.
ARHOST_INLINE void trace_path_packet(Work &work, std::uint32_t depth) {
    const Scene &scene = work.frame.scene;
    const QueuedRays next = take_packet(work, depth);
    RTCRayHit16 rays;
    set_ray(rays.ray, next.origin, next.direction, Float(far_away), Int(all_masks),
            select(is_seen(next.paths), Int(ray_of_eye), Int(0)));
    const Bool hit = trace(scene, scene.root, make_query(Coherence::incoherent), rays, next.active);
    const Bool sees_all = next.active & ~sees_only_virtual(next.paths);
    const Bool missed = sees_all & ~hit;
    if (any(missed)) {
        const Vec3 light = environment_towards(work, next.paths, next.direction, missed);
        add_radiance(work, next.paths, light, missed);
        add_seen(work, next.paths, light, missed);
    }
    if (scene.has_area_lights) {
        const Vec3 light = lamps_towards(work, next.paths, next.origin, next.direction, load(rays.ray.tfar));
        const Bool lit = sees_all & (largest(light) > Float(0.0f));
        if (any(lit)) {
            add_radiance(work, next.paths, light, lit);
            add_seen(work, next.paths, light, lit);
        }
    }
    if (any(hit))
        shade_path(work, rays, hit, next.paths);
}

// Returns the catcher_phase in which each pixel of a block is sampled.
ARHOST_INLINE Int phase_of_lanes() {
    return (lane_numbers() & Int(1)) | ((lane_numbers() >> Int(1)) & Int(2));
}

// Returns the pixels of a block in which virtual objects are sampled in this frame: one of each 2×2 pixels, and one
// of each surface that this pixel does not show.
ARHOST_INLINE Bool objects_in_turn(const Frame &frame, const Scratch &scratch, int first_pixel) {
    const int phase = frame.denoising->object_phase;
    if (phase < 0)
        return bool_of(true);
    const float *surfaces = scratch.guide[surface_guide] + first_pixel;
    const Int surface = bits_of(load(surfaces));
    const auto normal_of = [&](Int lane) __attribute__((always_inline)) {
        const float *const *rows = scratch.guide + normal_guide;
        return Vec3{pick(rows[0] + first_pixel, lane), pick(rows[1] + first_pixel, lane),
                    pick(rows[2] + first_pixel, lane)};
    };
    const Vec3 normal = normal_of(lane_numbers());
    const Int turn = (phase_of_lanes() - Int(phase)) & Int(3); // the first pixel with a surface is sampled
    Bool chosen = bool_of(true);
    for (int i = 1; i < 4; ++i) {
        const Int earlier = (phase_of_lanes() - Int(i)) & Int(3);
        const Int there = (lane_numbers() & Int(~(1 | block))) | (earlier & Int(1)) | ((earlier & Int(2)) << Int(1));
        const Bool same = (bits_of(pick(surfaces, there)) == surface) & (dot(normal_of(there), normal) > Float(0.8f));
        chosen = chosen & ~(same & (Int(i - 1) < turn));
    }
    return chosen;
}

// Keeps rays for sample_deferred().
ARHOST_INLINE void defer(DeferredPixels &deferred, Vec3 direction, Int pixel, Bool chosen) {
    alignas(64) float by_lane[DeferredPixels::rows][lanes];
    const Float values[] = {direction.x, direction.y, direction.z, float_of(pixel)};
    for (int row = 0; row < DeferredPixels::rows; ++row)
        store(by_lane[row], values[row]);
    for (unsigned remaining = mask_of(chosen.lane); remaining; remaining &= remaining - 1, ++deferred.count)
        for (int row = 0; row < DeferredPixels::rows; ++row)
            deferred.values[row][deferred.count] = by_lane[row][__builtin_ctz(remaining)];
}

// Calls shade(paths, rays, lanes) for the hits of full packets of deferred rays.
template <class Shade>
ARHOST_INLINE void trace_deferred(const Work &work, DeferredPixels &deferred, RTCScene bvh, Query query,
                                  unsigned mask, Shade shade) {
    for (std::int32_t first = 0; first < deferred.count; first += lanes) {
        const Bool active = lane_numbers() < Int(deferred.count - first);
        const auto row = [&](int i) __attribute__((always_inline)) {
            return load(deferred.values[i] + first);
        };
        RTCRayHit16 rays;
        set_ray(rays.ray, splat(work.frame.camera.eye), {row(0), row(1), row(2)}, Float(far_away),
                Int(static_cast<int>(mask)), Int(ray_of_eye));
        const Bool hit = trace(work.frame.scene, bvh, query, rays, active);
        if (any(hit))
            shade(Paths{select(active, bits_of(row(3)), Int(0)), -1, white(), 0, Float(0.0f)}, rays, hit);
    }
    deferred.count = 0;
}

// Samples the deferred pixels. Their random numbers have a sequence of their own at this vertex, as each pixel is
// sampled in every fourth frame only.
ARHOST_INLINE void sample_deferred(Work &work) {
    Scratch &scratch = work.scratch;
    if (scratch.catchers.count == 0 && scratch.objects.count == 0)
        return;
    const Scene &scene = work.frame.scene;
    const std::uint32_t sample = work.sample;
    work.sample = work.frame.denoising->first_random_in_turn + work.index;
    trace_deferred(
        work, scratch.catchers, scene.catchers, make_query(Coherence::coherent, true), catcher_mask,
        [&](const Paths &paths, const RTCRayHit16 &rays, const Bool &caught)
            __attribute__((always_inline)) { change_catcher(work, in_plane(paths, change_plane), rays, caught); });
    trace_deferred(
        work, scratch.objects, scene.root, make_query(Coherence::coherent), virtual_masks,
        [&](const Paths &paths, const RTCRayHit16 &rays, const Bool &hit)
            __attribute__((always_inline)) { shade_path(work, rays, hit, paths); });
    work.sample = sample;
}

// Shades pixels that show mirrors and glass away from their centres, so that edges of what these show become smooth
// over frames.
template <class DirectionAt>
ARHOST_INLINE void shade_specular(Work &work, const PrimaryHits &centre, const Paths &paths, DirectionAt direction_at,
                                  Bool active) {
    const Scene &scene = work.frame.scene;
    const arhost::raytracer_common::Sample &at = work.frame.samples[work.index];
    const PrimaryHits near =
        trace_primary(scene, splat(work.frame.camera.eye), direction_at(at.x, at.y), active, active);
    const Bool same =
        near.is_virtual & (object_number(scene, near.rays.hit) == object_number(scene, centre.rays.hit));
    if (any(same))
        shade_path(work, near.rays, same, paths);
    if (const Bool missed = active & ~same; any(missed))
        shade_path(work, centre.rays, missed, paths);
}

ARHOST_INLINE void clear_radiance(Work &work, int first_pixel) {
    const int planes_used = work.frame.scene.has_gloss ? plane_count : mirrored_plane;
    for (float *planes : work.scratch.radiance)
        for (int plane = 0; plane < planes_used; ++plane)
            store(planes + plane * tile_pixels + first_pixel, Float(0.0f));
}

// Traces more rays through pixels that show mirrors and glass. Returns whether any of them meets the same object.
// `direction`: through the pixels, away from their centres.
ARHOST_INLINE bool shade_specular_again(Work &work, int first_pixel, Vec3 direction, Bool active) {
    clear_radiance(work, first_pixel);
    const Scene &scene = work.frame.scene;
    const PrimaryHits hits = trace_primary(scene, splat(work.frame.camera.eye), direction, active, active);
    if (!any(hits.is_virtual))
        return false;
    const Int surface = bits_of(load(work.scratch.guide[surface_guide] + first_pixel)) & Int(mirrored_unit - 1);
    const Bool same = hits.is_virtual & (surface_of(scene, hits.rays.hit, hits.is_virtual) == surface);
    if (!any(same))
        return false;
    add_to_sum(work.scratch, coverage_row, first_pixel, select(same, Float(1.0f), Float(0.0f)));
    shade_path(work, hits.rays, same, {lane_numbers() + Int(first_pixel), first_pixel, white(), 0, Float(0.0f)});
    return true;
}

// Traces the primary rays of a block and shades their hits. Returns whether any pixel can be affected.
// `direction_at`: (x, y) px from the pixels' centres; `near`: see trace_primary().
template <class DirectionAt>
ARHOST_INLINE bool primary_path(Work &work, int first_pixel, Vec3 direction, DirectionAt direction_at, Bool active,
                                Bool near) {
    const Scene &scene = work.frame.scene;
    const Vec3 eye = splat(work.frame.camera.eye);
    clear_radiance(work, first_pixel);
    const PrimaryHits hits = trace_primary(scene, eye, direction, active, near);
    if (work.frame.denoising && work.index == 0)
        store_guides(work, hits, direction, first_pixel);
    const Paths paths{lane_numbers() + Int(first_pixel), first_pixel, white(), 0, Float(0.0f)};
    if (work.frame.denoising && work.frame.denoising->catcher_phase >= 0)
        defer(work.scratch.catchers, direction, paths.pixel,
              hits.caught & (phase_of_lanes() == Int(work.frame.denoising->catcher_phase)));
    else if (any(hits.caught))
        change_catcher(work, in_plane(paths, change_plane), hits.catcher_rays, hits.caught);
    if (!any(hits.is_virtual))
        return any(hits.caught);
    add_to_sum(work.scratch, coverage_row, first_pixel, select(hits.is_virtual, Float(1.0f), Float(0.0f)));
    Bool rest = hits.is_virtual;
    if (work.frame.denoising) {
        const Bool specular =
            rest & is_kind(bits_of(load(work.scratch.guide[surface_guide] + first_pixel)), specular_surface);
        rest = rest & ~specular;
        if (any(specular)) {
            if (work.frame.denoising->seen_moves()) // jitter would flicker
                shade_path(work, hits.rays, specular, paths);
            else
                shade_specular(work, hits, paths, direction_at, specular);
        }
        if (work.frame.denoising->object_phase >= 0) {
            defer(work.scratch.objects, direction, paths.pixel,
                  rest & objects_in_turn(work.frame, work.scratch, first_pixel));
            return true;
        }
    }
    if (any(rest))
        shade_path(work, hits.rays, rest, paths);
    return true;
}

// Adds the radiance of the current sample and the change of the catchers to the pixels' sums. The bound keeps a
// single random ray that hits a tiny, very bright light from dominating the pixel.
ARHOST_INLINE void accumulate_path(const Frame &frame, Scratch &scratch, int first_pixel) {
    const Float bound(frame.path.max_radiance);
    const auto bounded = [&](const float *from) __attribute__((always_inline)) {
        const Float value = load(from);
        return select(abs(value) < Float(1e30f), min(max(value, -bound), bound), Float(0.0f)); // NaN: 0
    };
    const auto add = [&](int row, Plane plane) __attribute__((always_inline)) {
        for (int i = 0; i < 3; ++i)
            add_to_sum(scratch, row + i, first_pixel,
                       bounded(scratch.radiance[i] + plane * tile_pixels + first_pixel));
    };
    add(light_row, object_plane);
    if (!frame.scene.has_catchers)
        return;
    add(change_row, change_plane);
    if (!frame.scene.has_gloss)
        return;
    add(light_row, mirrored_plane);
    add(covered_row, covered_plane);
}

ARHOST_INLINE LinearBlock linear_mean(const Frame &frame, const Scratch &scratch, int first_pixel,
                                      std::uint32_t count, int x, int y) {
    const Float samples(static_cast<float>(count));
    const auto mean = [&](int row) __attribute__((always_inline)) {
        return load(scratch.sum[row] + first_pixel) / samples; // exactly 1 if all samples are covered
    };
    const Float uncovered = Float(1.0f) - mean(coverage_row);
    LinearBlock linear{{mean(light_row), mean(light_row + 1), mean(light_row + 2)},
                       {uncovered, uncovered, uncovered}};
    if (frame.scene.has_catchers)
        linear.transmittance =
            linear.transmittance + Vec3{mean(change_row), mean(change_row + 1), mean(change_row + 2)};
    linear.transmittance = bounded_for_halves(linear.transmittance);
    if (frame.scene.has_gloss) {
        const Float share = Float(1.0f) / max(uncovered, Float(1e-3f));
        const auto mean_behind = [&](int row) __attribute__((always_inline)) {
            return Vec3{mean(row), mean(row + 1), mean(row + 2)} * share;
        };
        const Float column = to_float(lane_numbers() & Int(block - 1)) + Float(static_cast<float>(x) + 0.5f),
                    row = to_float(lane_numbers() >> Int(2)) + Float(static_cast<float>(y) + 0.5f);
        remove_covered(frame.path.video, mean_behind(covered_row), mean_behind(matt_row), column, row, linear);
    }
    linear.added = bounded_for_halves(linear.added);
    return linear;
}
