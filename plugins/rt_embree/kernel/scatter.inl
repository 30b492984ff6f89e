// SPDX-License-Identifier: Apache-2.0
//
// Rays that go on from surfaces. They are not followed at once: they wait, sorted by depth, until there are
// enough for a whole packet, so that packets stay full however rays scatter.
#pragma once
#include "lights.inl"

// Whose light sixteen rays bring: their pixels' numbers in the tile, and the share of it that arrives.
struct Paths {
    Int pixel;
    std::int32_t first_pixel; // of primary rays, whose pixels follow one another
    Vec3 throughput;
    std::uint32_t depth; // bounces so far
};

// Where a tile is being worked at.
struct Work {
    const Frame &frame;
    Scratch &scratch;
    std::uint32_t deepest; // depth at which rays wait, at most
    Int seed;              // the tile's, of random numbers
    std::uint32_t sample;  // of all that are averaged
};

ARHOST_INLINE Random random_of(const Work &work, const Paths &paths) {
    return {paths.pixel ^ Int(static_cast<int>(paths.depth << 12)), work.seed, work.sample};
}

ARHOST_INLINE void add_light(Work &work, const Paths &paths, Vec3 light, Bool active) {
    const Vec3 arriving = paths.throughput * light;
    float *const *to = work.scratch.light;
    if (paths.depth == 0) {
        const auto add = [&](int i, Float more) __attribute__((always_inline)) {
            float *at = to[i] + paths.first_pixel;
            store(at, load(at) + select(active, more, Float(0.0f)));
        };
        add(0, arriving.x);
        add(1, arriving.y);
        add(2, arriving.z);
        return;
    }
    alignas(64) float x[lanes], y[lanes], z[lanes];
    alignas(64) int pixel[lanes];
    store(x, arriving.x);
    store(y, arriving.y);
    store(z, arriving.z);
    store(pixel, paths.pixel);
    for (unsigned left = mask_of(active.lane); left; left &= left - 1) {
        const int i = __builtin_ctz(left);
        to[0][pixel[i]] += x[i];
        to[1][pixel[i]] += y[i];
        to[2][pixel[i]] += z[i];
    }
}

// A ray of the next depth for each of the lanes.
ARHOST_INLINE void send_on(Work &work, const Paths &from, Vec3 origin, Vec3 direction, Vec3 throughput, Bool active) {
    alignas(64) float numbers[WaitingRays::rows][lanes];
    const Float values[] = {origin.x,    origin.y,     origin.z,     direction.x,  direction.y,
                            direction.z, throughput.x, throughput.y, throughput.z, float_of(from.pixel)};
    for (int row = 0; row < WaitingRays::rows; ++row)
        store(numbers[row], values[row]);
    WaitingRays &waiting = work.scratch.waiting[from.depth];
    work.deepest = from.depth > work.deepest ? from.depth : work.deepest;
    float *to = waiting.numbers + waiting.count;
    for (unsigned left = mask_of(active.lane); left; left &= left - 1, ++to) {
        const int i = __builtin_ctz(left);
        for (int row = 0; row < WaitingRays::rows; ++row)
            to[row * waiting.capacity] = numbers[row][i];
    }
    waiting.count += __builtin_popcount(mask_of(active.lane));
}

// Below this a ray's light can't be seen.
constexpr float faint = 1e-4f;

ARHOST_INLINE Vec3 reflected(const Surface &s, Vec3 direction) {
    return mirror_direction_off_facet(direction, s.normal, s.geometric_normal);
}

ARHOST_INLINE void reflect(Work &work, const Paths &paths, const Surface &s, Vec3 direction, Vec3 share,
                           Bool active) {
    const Vec3 throughput = paths.throughput * share;
    active = active & (largest(throughput) > Float(faint));
    if (any(active))
        send_on(work, paths, s.position + s.geometric_normal * s.offset, reflected(s, direction), throughput, active);
}

// Both branches, or the one that chance chooses. What is not followed looks like the cutoff colour.
ARHOST_INLINE void scatter_in_glass(Work &work, const Paths &paths, const Surface &s, Vec3 direction,
                                    const arhost_material &glass, Bool active) {
    const Vec3 left = select(s.from_behind, bouguer(splat(glass.extinction), s.way), white());
    const Vec3 throughput = paths.throughput * left;

    const Float ratio = select(s.from_behind, Float(glass.index), Float(1 / glass.index));
    Vec3 normal = s.normal;
    Float cosine = max(-dot(direction, normal), Float(0.0f));
    Float squared = refracted_cosine_squared(cosine, ratio);
    Float refracted_cosine = sqrt(max(squared, Float(0.0f)));
    Vec3 refracted = refracted_direction(direction, normal, ratio, cosine, refracted_cosine);
    // As with reflection: a refracted ray that stays outside is bent by the facet's own normal.
    const Bool astray = (dot(refracted, s.geometric_normal) > Float(0.0f)) & (squared > Float(0.0f));
    if (any(active & astray)) {
        normal = select(astray, s.geometric_normal, normal);
        cosine = max(-dot(direction, normal), Float(0.0f));
        squared = refracted_cosine_squared(cosine, ratio);
        refracted_cosine = sqrt(max(squared, Float(0.0f)));
        refracted = refracted_direction(direction, normal, ratio, cosine, refracted_cosine);
    }
    const Bool total = squared < Float(0.0f);
    const Float reflectance = glass_reflected_share(s.from_behind, cosine, squared, Float(glass.fresnel_exponent),
                                                    Float(glass.fresnel_minimum), Float(glass.fresnel_maximum));

    const Vec3 inside = s.position - s.geometric_normal * s.offset;
    Vec3 refracted_share = throughput * splat(glass.refraction) * (Float(1.0f) - reflectance);
    Vec3 reflected_share = throughput * splat(glass.reflectivity) * reflectance;
    Bool refracts = active & ~total, reflects = active;
    if (work.frame.one_path) {
        const Bool chosen = pair(random_of(work, paths), glass_purpose, 0, 1).u < reflectance;
        refracts = refracts & ~chosen;
        reflects = reflects & chosen;
        refracted_share = throughput * splat(glass.refraction);
        reflected_share = throughput * splat(glass.reflectivity);
    }
    const auto follow = [&](Vec3 share, Bool lanes, bool too_deep) __attribute__((always_inline)) {
        const Bool important = lanes & bool_of(!too_deep) & (luminance(share) > Float(glass.importance_cutoff));
        const Bool cut = lanes & ~important;
        if (any(cut)) {
            Paths ended = paths;
            ended.throughput = share;
            add_light(work, ended, splat(glass.cutoff_colour), cut);
        }
        return important;
    };
    refracts = follow(refracted_share, refracts, paths.depth >= glass.refraction_depth);
    if (any(refracts))
        send_on(work, paths, inside, refracted, refracted_share, refracts);
    reflects = follow(reflected_share, reflects, paths.depth >= glass.reflection_depth);
    if (any(reflects))
        send_on(work, paths, s.position + s.geometric_normal * s.offset, reflected(s, direction), reflected_share,
                reflects);
}

// Rays that would change no 8-bit code by half a step end.
constexpr float least_throughput = 2e-3f;

// A ray off a microfacet.
ARHOST_INLINE void scatter_off_roughness(Work &work, const Paths &paths, const Surface &s, Vec3 to_eye, Bool active) {
    const Pair where = pair(random_of(work, paths), rough_purpose, 0, 1);
    const Vec3 half_way = ggx_half_way(s.normal, to_eye, s.alpha, where.u, where.v);
    const Vec3 direction = mirror_direction(-to_eye, half_way);
    const Float cosine = dot(direction, s.normal);
    // The masking of the way in is in the choice of the facet.
    const Vec3 share = schlick(s.specular, dot(to_eye, half_way)) * ggx_unmasked(cosine, s.alpha);
    const Vec3 throughput = paths.throughput * share;
    active = active & (cosine > Float(0.0f)) & (dot(direction, s.geometric_normal) > Float(0.0f)) &
             (largest(throughput) > Float(least_throughput));
    if (any(active))
        send_on(work, paths, s.position + s.geometric_normal * s.offset, direction, throughput, active);
}

// The light of surfaces that rays have hit, and the rays that go on from there.
ARHOST_INLINE void shade(Work &work, const RTCRayHit16 &rays, Bool active, const Paths &paths) {
    const Scene &scene = work.frame.scene;
    const Surface s = surface_at(scene, rays, active);
    const Vec3 direction = normalize(direction_of(rays.ray));
    const Bool lit = active & s.is_lit;
    if (any(lit))
        add_light(work, paths, direct_light(work.frame, s, -direction, lit, random_of(work, paths)), lit);
    if (!s.any_scattering)
        return;
    if (paths.depth >= scene.max_depth) {
        // What a ray would have brought that starts no more: of glass the colour that stands for it.
        for_each_object(scene, rays.hit, active, [&](const Object &object, Bool here) {
            if (object.material->model == ARHOST_MATERIAL_GLASS)
                add_light(work, paths, splat(object.material->cutoff_colour), here);
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
            scatter_off_roughness(work, paths, s, -direction, here);
    });
}

// Traces up to 16 of the rays that wait at a depth, the newest first.
ARHOST_INLINE void follow_packet(Work &work, std::uint32_t depth) {
    WaitingRays &waiting = work.scratch.waiting[depth];
    const std::int32_t first = waiting.count > lanes ? waiting.count - lanes : 0;
    const Bool active = lane_numbers() < Int(waiting.count - first);
    const auto row = [&](int i) __attribute__((always_inline)) {
        return load(waiting.numbers + i * waiting.capacity + first);
    };
    const Paths paths{select(active, bits_of(row(9)), Int(0)), 0, {row(6), row(7), row(8)}, depth + 1};
    RTCRayHit16 rays;
    set_ray(rays.ray, {row(0), row(1), row(2)}, {row(3), row(4), row(5)}, Float(far_away), Int(all_masks));
    waiting.count = first;
    const Bool hit = trace(work.frame.scene, work.frame.scene.root, make_query(Coherence::incoherent), rays, active);
    const Bool missed = active & ~hit;
    if (any(missed))
        add_light(work, paths, environment_light(work.frame.scene, direction_of(rays.ray)), missed);
    if (any(hit))
        shade(work, rays, hit, paths);
}

// Until none waits. The deepest packet that is full comes first, so that at most two packets wait at a depth
// but the first; where none is full, the shallowest, whose rays may fill the others.
ARHOST_INLINE void follow_all(Work &work) {
    WaitingRays *waiting = work.scratch.waiting;
    for (;;) {
        std::uint32_t chosen = work.deepest + 1;
        for (std::uint32_t depth = work.deepest + 1; depth-- > 0;) {
            if (waiting[depth].count >= lanes) {
                chosen = depth;
                break;
            }
            if (waiting[depth].count > 0)
                chosen = depth;
        }
        if (chosen > work.deepest)
            return;
        follow_packet(work, chosen);
    }
}
