// SPDX-License-Identifier: Apache-2.0
//
// Ray packets and their hits.
#pragma once
#include "raytracer_common/packets/vectors.inl"

constexpr int no_hit = static_cast<int>(RTC_INVALID_GEOMETRY_ID);

// `flags`: of RayFlag.
template <class Ray>
ARHOST_INLINE void set_ray(Ray &ray, Vec3 origin, Vec3 direction, Float end, Int mask, Int flags = Int(0)) {
    store(ray.org_x, origin.x);
    store(ray.org_y, origin.y);
    store(ray.org_z, origin.z);
    store(ray.tnear, Float(0.0f));
    store(ray.dir_x, direction.x);
    store(ray.dir_y, direction.y);
    store(ray.dir_z, direction.z);
    store(ray.time, Float(0.0f));
    store(ray.tfar, end);
    store(ray.mask, mask);
    store(ray.id, Int(0));
    store(ray.flags, flags);
}
ARHOST_INLINE Vec3 origin_of(const RTCRay16 &ray) {
    return {load(ray.org_x), load(ray.org_y), load(ray.org_z)};
}
ARHOST_INLINE Vec3 direction_of(const RTCRay16 &ray) {
    return {load(ray.dir_x), load(ray.dir_y), load(ray.dir_z)};
}

// Returns false for rays with NaN, infinite or huge components, which result, for example, from triangles of 1e-15
// mm. Embree aborts on such rays.
ARHOST_INLINE Bool is_valid_ray(Vec3 origin, Vec3 direction) {
    return (largest(origin) < Float(1e18f)) & (largest(direction) < Float(1e18f)) &
           (dot(direction, direction) >= Float(0.0f));
}

// Finds the closest hit of each active lane. Returns the lanes that have a hit. `bvh` is `scene.root` or
// `scene.catchers`.
ARHOST_INLINE Bool trace(const Scene &scene, RTCScene bvh, Query query, RTCRayHit16 &rays, Bool active) {
    alignas(64) int valid[lanes];
    active = active & is_valid_ray(origin_of(rays.ray), direction_of(rays.ray));
    store(valid, active);
    query.random_seed = scene.random_seed;
    store(rays.hit.geomID, Int(no_hit));
    store(rays.hit.instID[0], Int(no_hit));
    intersect16(valid, bvh, scene.packet_width, query, rays);
    return active & (load(rays.hit.geomID) != Int(no_hit));
}

// Returns the active lanes whose rays are occluded.
ARHOST_INLINE Bool blocked(const Scene &scene, RTCRay16 &rays, Bool active) {
    alignas(64) int valid[lanes];
    active = active & is_valid_ray(origin_of(rays), direction_of(rays));
    store(valid, active);
    // The rays of a packet aim at different points of the lights. Besides, Embree 3.13.5 hangs in coherent occlusion
    // queries through instances with AVX-512.
    Query query = make_query(Coherence::incoherent);
    query.random_seed = scene.random_seed;
    occluded16(valid, scene.root, scene.packet_width, query, rays);
    return active & (load(rays.tfar) < Float(0.0f)); // Embree sets −∞ on a hit
}

// Returns the index in `scene.objects` of the object that each lane hits.
ARHOST_INLINE Int object_number(const Scene &scene, const RTCHit16 &hit) {
    const Int instance = load(hit.instID[0]);
    const Bool by_geometry = (instance == Int(no_hit)) | (instance == Int(scene.static_instance));
    return select(by_geometry, load(hit.geomID), instance);
}

// Calls use(object, lanes) for each object that an active lane hits, with the lanes that hit it. A packet mostly hits
// only one or two objects.
template <class Use>
ARHOST_INLINE void for_each_object(const Scene &scene, const RTCHit16 &hit, Bool active, Use use) {
    const Int numbers = object_number(scene, hit);
    alignas(64) int number_of[lanes];
    store(number_of, numbers);
    for (unsigned remaining = mask_of(active.lane); remaining;) {
        const int number = number_of[__builtin_ctz(remaining)];
        const Bool here = active & (numbers == Int(number));
        remaining &= ~mask_of(here.lane);
        use(scene.objects[number], here);
    }
}
