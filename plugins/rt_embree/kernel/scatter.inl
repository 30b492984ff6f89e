// SPDX-License-Identifier: Apache-2.0
//
// Secondary rays. Rays of the same depth wait in a queue until they fill a packet of 16, because partly filled
// packets waste lanes.
#pragma once
#include "lights.inl"

// Pixel and throughput of 16 paths.
struct Paths {
    Int pixel;                // number of the pixel in the tile, plus tile_pixels · its Plane
    std::int32_t first_pixel; // pixel of lane 0 of primary rays, if their pixels are consecutive; else −1
    Vec3 throughput;
    std::uint32_t depth;   // number of bounces so far
    Float inverse_density; // see RayQueue; 0 for primary rays
};

// State of the tile being rendered.
struct Work {
    const Frame &frame;
    Scratch &scratch;
    std::uint32_t deepest; // no queue of a greater depth has rays
    std::uint32_t seed;    // seed of the tile's random numbers
    std::uint32_t sample;  // index of the current sample among all accumulated ones
    std::uint32_t index;   // among those of the frame
};

ARHOST_INLINE Random random_of(const Work &work, const Paths &paths) {
    return {paths.pixel ^ Int(static_cast<int>(paths.depth << 12)), Int(static_cast<int>(work.seed)), work.sample};
}

// Adds to three rows. Lanes may have the same pixel.
ARHOST_INLINE void add_to_pixels(float *const *rows, Int pixels, Vec3 values, Bool active) {
    alignas(64) float x[lanes], y[lanes], z[lanes];
    alignas(64) int pixel[lanes];
    store(x, values.x);
    store(y, values.y);
    store(z, values.z);
    store(pixel, pixels);
    for (unsigned remaining = mask_of(active.lane); remaining; remaining &= remaining - 1) {
        const int i = __builtin_ctz(remaining);
        rows[0][pixel[i]] += x[i];
        rows[1][pixel[i]] += y[i];
        rows[2][pixel[i]] += z[i];
    }
}

ARHOST_INLINE void add_radiance(Work &work, const Paths &paths, Vec3 radiance, Bool active) {
    const Vec3 arriving = paths.throughput * radiance;
    float *const *to = work.scratch.radiance;
    if (paths.depth == 0 && paths.first_pixel >= 0) {
        const auto add = [&](int i, Float more) __attribute__((always_inline)) {
            float *at = to[i] + paths.first_pixel;
            store(at, load(at) + select(active, more, Float(0.0f)));
        };
        add(0, arriving.x);
        add(1, arriving.y);
        add(2, arriving.z);
        return;
    }
    add_to_pixels(to, paths.pixel, arriving, active);
}

// Adds a secondary ray for each active lane to the queue of the depth `from.depth`. `inverse_density`: see RayQueue.
ARHOST_INLINE void enqueue(Work &work, const Paths &from, Vec3 origin, Vec3 direction, Vec3 throughput, Bool active,
                           Float inverse_density) {
    alignas(64) float by_lane[RayQueue::rows][lanes];
    const Float values[] = {
        origin.x,     origin.y,     origin.z,     direction.x,     direction.y,         direction.z,
        throughput.x, throughput.y, throughput.z, inverse_density, float_of(from.pixel)};
    for (int row = 0; row < RayQueue::rows; ++row)
        store(by_lane[row], values[row]);
    RayQueue &queue = work.scratch.queues[from.depth];
    work.deepest = from.depth > work.deepest ? from.depth : work.deepest;
    float *to = queue.values + queue.count;
    for (unsigned remaining = mask_of(active.lane); remaining; remaining &= remaining - 1, ++to) {
        const int i = __builtin_ctz(remaining);
        for (int row = 0; row < RayQueue::rows; ++row)
            to[row * queue.capacity] = by_lane[row][i];
    }
    queue.count += __builtin_popcount(mask_of(active.lane));
}

// Adds rays that mirrors and glass reflect or refract.
ARHOST_INLINE void enqueue(Work &work, const Paths &from, Vec3 origin, Vec3 direction, Vec3 throughput, Bool active) {
    const Float density = from.inverse_density;
    enqueue(work, from, origin, direction, throughput, active, select(density > Float(0.0f), -density, density));
}

// Reflected rays below this throughput are invisible.
constexpr float min_throughput = 1e-4f;

ARHOST_INLINE Vec3 reflected(const Surface &s, Vec3 direction) {
    return mirror_direction_off_facet(direction, s.normal, s.geometric_normal);
}

ARHOST_INLINE void reflect(Work &work, const Paths &paths, const Surface &s, Vec3 direction, Vec3 reflectance,
                           Bool active) {
    const Vec3 throughput = paths.throughput * reflectance;
    active = active & (largest(throughput) > Float(min_throughput));
    if (any(active))
        enqueue(work, paths, s.position + s.geometric_normal * s.offset, reflected(s, direction), throughput, active);
}

// The refraction of rays at a surface. `cosine`: cosine of the angle of incidence.
struct Refraction {
    // Cosine_squared: of the angle of refraction; negative for total internal reflection.
    Float cosine, cosine_squared;
    Vec3 direction;
};
ARHOST_INLINE Refraction refraction_at(Vec3 direction, Vec3 normal, Float ratio) {
    const Float cosine = max(-dot(direction, normal), Float(0.0f));
    const Float squared = refracted_cosine_squared(cosine, ratio);
    return {cosine, squared, refracted_direction(direction, normal, ratio, cosine, sqrt(max(squared, Float(0.0f))))};
}

// If refraction at the interpolated normal leaves the ray on the wrong side of the surface, the geometric normal is
// used instead; reflected() does the same for reflection. `ratio`: as in refracted_cosine_squared().
ARHOST_INLINE Refraction refraction_of(const Surface &s, Vec3 direction, Float ratio, Bool active) {
    const Refraction refraction = refraction_at(direction, s.normal, ratio);
    const Bool wrong_side =
        (dot(refraction.direction, s.geometric_normal) > Float(0.0f)) & (refraction.cosine_squared > Float(0.0f));
    if (!any(active & wrong_side))
        return refraction;
    return refraction_at(direction, select(wrong_side, s.geometric_normal, s.normal), ratio);
}

// Queues the reflected and the refracted ray, or, with `single_path`, only one of them, chosen at random. A ray is
// not traced if it exceeds the depth limit or falls below the importance cutoff. It then contributes the material's
// cutoff colour.
ARHOST_INLINE void scatter_in_glass(Work &work, const Paths &paths, const Surface &s, Vec3 direction,
                                    const arhost_material &glass, Bool active) {
    const Vec3 transmittance = select(s.back_face, bouguer(splat(glass.extinction), s.distance), white());
    const Vec3 throughput = paths.throughput * transmittance;

    const Float ratio = select(s.back_face, Float(glass.index), Float(1 / glass.index));
    const Refraction refraction = refraction_of(s, direction, ratio, active);
    const Bool total = refraction.cosine_squared < Float(0.0f);
    const Float reflectance = glass_reflected_fraction(s.back_face, refraction.cosine, refraction.cosine_squared,
                                                       Float(glass.fresnel_exponent), Float(glass.fresnel_minimum),
                                                       Float(glass.fresnel_maximum));

    const Vec3 inside = s.position - s.geometric_normal * s.offset;
    Vec3 refracted_throughput = throughput * splat(glass.refraction) * (Float(1.0f) - reflectance);
    Vec3 reflected_throughput = throughput * splat(glass.reflectivity) * reflectance;
    Bool refracts = active & ~total, reflects = active;
    if (work.frame.single_path) {
        const Bool chosen = pair(random_of(work, paths), glass_purpose, 0, 1).u < reflectance;
        refracts = refracts & ~chosen;
        reflects = reflects & chosen;
        refracted_throughput = throughput * splat(glass.refraction);
        reflected_throughput = throughput * splat(glass.reflectivity);
    }
    const auto follow = [&](Vec3 branch, Bool lanes, bool too_deep) __attribute__((always_inline)) {
        const Bool important = lanes & bool_of(!too_deep) & (luminance(branch) > Float(glass.importance_cutoff));
        const Bool cut = lanes & ~important;
        if (any(cut)) {
            Paths ended = paths;
            ended.throughput = branch;
            add_radiance(work, ended, splat(glass.cutoff_colour), cut);
        }
        return important;
    };
    refracts = follow(refracted_throughput, refracts, paths.depth >= glass.refraction_depth);
    if (any(refracts))
        enqueue(work, paths, inside, refraction.direction, refracted_throughput, refracts);
    reflects = follow(reflected_throughput, reflects, paths.depth >= glass.reflection_depth);
    if (any(reflects))
        enqueue(work, paths, s.position + s.geometric_normal * s.offset, reflected(s, direction),
                reflected_throughput, reflects);
}

// A ray that is reflected off a randomly sampled microfacet.
struct RoughReflection {
    Vec3 direction, reflectance;
    Float density; // per steradian
    Bool leaves;   // the ray goes away from the surface
};

// Bends the normals of rough virtual surfaces so that they reflect the eye's rays away from the surface.
ARHOST_INLINE void bend_normals(Surface &s, Vec3 to_eye) {
    const Bool bends = s.is_rough & ~s.is_real;
    s.normal = select(bends, reflecting_normal(s.normal, s.geometric_normal, to_eye), s.normal);
    if (s.any_coat)
        s.coat_normal = select(bends, reflecting_normal(s.coat_normal, s.geometric_normal, to_eye), s.coat_normal);
    if (s.any_anisotropic)
        turn_tangents(s);
}

// Microfacets of a rough surface. Vectors are in world coordinates.
ARHOST_INLINE Vec3 in_tangents(const Surface &s, Vec3 a) {
    return {dot(a, s.tangent), dot(a, s.bitangent), dot(a, s.normal)};
}
ARHOST_INLINE Vec3 half_vector_of(const Surface &s, Vec3 to_eye, Pair uv) {
    return s.any_anisotropic ? anisotropic_half_vector(s.tangent, s.bitangent, s.normal, to_eye, s.tangent_alpha,
                                                       s.alpha, uv.u, uv.v)
                             : ggx_half_vector(s.normal, to_eye, s.alpha, uv.u, uv.v);
}
ARHOST_INLINE Float reflection_density(const Surface &s, Vec3 to_eye, Vec3 half_vector) {
    return s.any_anisotropic ? anisotropic_reflection_density(in_tangents(s, to_eye), in_tangents(s, half_vector),
                                                              s.tangent_alpha, s.alpha)
                             : ggx_reflection_density(dot(s.normal, to_eye), dot(s.normal, half_vector), s.alpha);
}
ARHOST_INLINE Float rough_lobe(const Surface &s, Vec3 to_eye, Vec3 to_light, Vec3 half_vector) {
    return s.any_anisotropic
               ? anisotropic_lobe(in_tangents(s, to_light), in_tangents(s, to_eye), in_tangents(s, half_vector),
                                  s.tangent_alpha, s.alpha)
               : ggx_lobe(lambert(s.normal, to_light), dot(s.normal, to_eye), dot(s.normal, half_vector), s.alpha);
}

ARHOST_INLINE RoughReflection sample_rough(const Surface &s, Vec3 to_eye, Pair uv) {
    const Vec3 half_vector = ggx_half_vector(s.normal, to_eye, s.alpha, uv.u, uv.v);
    const Vec3 direction = mirror_direction(-to_eye, half_vector);
    const Float cosine = dot(direction, s.normal);
    // Sampling visible normals already accounts for the masking of `to_eye`.
    return {direction, fresnel_of(s, dot(to_eye, half_vector)) * ggx_masking(cosine, s.alpha),
            ggx_reflection_density(dot(s.normal, to_eye), dot(s.normal, half_vector), s.alpha),
            (cosine > Float(0.0f)) & (dot(direction, s.geometric_normal) > Float(0.0f))};
}

ARHOST_INLINE void enqueue(Work &work, const Paths &from, const Surface &s, const RoughReflection &ray, Bool active) {
    const Vec3 throughput = from.throughput * ray.reflectance;
    active = active & ray.leaves & (largest(throughput) > Float(min_throughput));
    if (any(active))
        enqueue(work, from, s.position + s.geometric_normal * s.offset, ray.direction, throughput, active,
                Float(1.0f) / max(ray.density, Float(1e-30f)));
}

ARHOST_INLINE void scatter_rough(Work &work, const Paths &paths, const Surface &s, Vec3 to_eye, Bool active) {
    enqueue(work, paths, s, sample_rough(s, to_eye, pair(random_of(work, paths), rough_purpose, 0, 1)), active);
}

// Adds the radiance of the hit surfaces and queues their secondary rays.
ARHOST_INLINE void shade(Work &work, const RTCRayHit16 &rays, Bool active, const Paths &paths) {
    const Scene &scene = work.frame.scene;
    const Surface s = surface_at(scene, rays, active);
    const Vec3 direction = normalize(direction_of(rays.ray));
    const Bool lit = active & s.is_lit;
    const bool rays_follow = paths.depth < scene.max_depth;
    if (any(lit))
        add_radiance(work, paths, direct_light(work.frame, s, -direction, rays_follow, lit, random_of(work, paths)),
                     lit);
    if (const Bool unlit = active & s.is_unlit; any(unlit))
        add_radiance(work, paths, s.emission, unlit);
    if (!s.any_scattering)
        return;
    if (!rays_follow) {
        // At the depth limit, glass shows its cutoff colour.
        for_each_object(scene, rays.hit, active, [&](const Object &object, Bool here) {
            if (object.material->model == ARHOST_MATERIAL_GLASS)
                add_radiance(work, paths, splat(object.material->cutoff_colour), here);
        });
        return;
    }
    for_each_object(scene, rays.hit, active, [&](const Object &object, Bool here) {
        const arhost_material &material = *object.material;
        if (material.model == ARHOST_MATERIAL_MIRROR)
            reflect(work, paths, s, direction, splat(material.reflectivity), here);
        else if (material.model == ARHOST_MATERIAL_METAL)
            reflect(work, paths, s, direction, schlick(splat(material.reflectivity), -dot(direction, s.normal)),
                    here);
        else if (material.model == ARHOST_MATERIAL_GLASS)
            scatter_in_glass(work, paths, s, direction, material, here);
        else if (material.model == ARHOST_MATERIAL_METALLIC_ROUGHNESS)
            scatter_rough(work, paths, s, -direction, here);
    });
}

// Rays removed from a queue.
struct QueuedRays {
    Paths paths;
    Vec3 origin, direction;
    Bool active;
};

// Removes the newest rays, at most 16, from the queue of `depth`.
ARHOST_INLINE QueuedRays take_packet(Work &work, std::uint32_t depth) {
    RayQueue &queue = work.scratch.queues[depth];
    const std::int32_t first = queue.count > lanes ? queue.count - lanes : 0;
    const Bool active = lane_numbers() < Int(queue.count - first);
    const auto row = [&](int i) __attribute__((always_inline)) {
        return load(queue.values + i * queue.capacity + first);
    };
    const Float inverse_density = select(active, row(9), Float(0.0f));
    queue.count = first;
    return {{select(active, bits_of(row(10)), Int(0)), 0, {row(6), row(7), row(8)}, depth + 1, inverse_density},
            {row(0), row(1), row(2)},
            {row(3), row(4), row(5)},
            active};
}

// Traces rays of the queue of `depth` and shades their hits.
ARHOST_INLINE void trace_queued_packet(Work &work, std::uint32_t depth) {
    const QueuedRays next = take_packet(work, depth);
    const Paths &paths = next.paths;
    RTCRayHit16 rays;
    set_ray(rays.ray, next.origin, next.direction, Float(far_away), Int(all_masks), Int(ray_of_eye));
    const Bool hit =
        trace(work.frame.scene, work.frame.scene.root, make_query(Coherence::incoherent), rays, next.active);
    const Bool missed = next.active & ~hit;
    if (any(missed))
        add_radiance(work, paths, arriving_from_environment(work.frame, next.direction, paths.inverse_density),
                     missed);
    if (work.frame.scene.has_area_lights) {
        const Vec3 light = arriving_from_area_lights(
            work.frame, next.origin, next.direction, load(rays.ray.tfar), paths.inverse_density,
            [&](std::uint32_t) { return static_cast<float>(work.frame.light_samples); });
        const Bool lit = next.active & (largest(light) > Float(0.0f));
        if (any(lit))
            add_radiance(work, paths, light, lit);
    }
    if (any(hit))
        shade(work, rays, hit, paths);
}

// Traces packets until all queues are empty. Picks the deepest queue that holds a full packet. This keeps every queue
// except the first below four packets. If no queue holds a full packet, picks the shallowest non-empty queue,
// because its secondary rays may fill the deeper queues.
template <class TracePacket> ARHOST_INLINE void trace_queued_rays(Work &work, TracePacket trace_packet) {
    RayQueue *queues = work.scratch.queues;
    for (;;) {
        std::uint32_t chosen = work.deepest + 1;
        for (std::uint32_t depth = work.deepest + 1; depth-- > 0;) {
            if (queues[depth].count >= lanes) {
                chosen = depth;
                break;
            }
            if (queues[depth].count > 0)
                chosen = depth;
        }
        if (chosen > work.deepest)
            return;
        trace_packet(work, chosen);
    }
}
