// SPDX-License-Identifier: Apache-2.0
//
// Hits of the primary rays of a block of 4×4 pixels, and sums over the samples of a pixel.
#pragma once
#include "scatter.inl"

#include "raytracer_common/packets/image.inl"

ARHOST_INLINE void add_to_sum(Scratch &scratch, int row, int first_pixel, Float more) {
    float *to = scratch.sum[row] + first_pixel;
    store(to, load(to) + more);
}

// Returns the lanes whose rays pass through one of the windows. `direction`: in camera axes, with z = 1.
ARHOST_INLINE Bool in_windows(const Windows &windows, Vec3 direction, Bool active) {
    if (windows.count < 0)
        return active;
    Bool inside = bool_of(false);
    for (std::int32_t i = 0; i < windows.count; ++i) {
        const float *window = windows.bounds[i];
        inside = inside | ((direction.x >= Float(window[0])) & (direction.y >= Float(window[1])) &
                           (Float(window[2]) >= direction.x) & (Float(window[3]) >= direction.y));
    }
    return active & inside;
}

struct PrimaryHits {
    RTCRayHit16 rays, catcher_rays;
    Bool is_virtual; // `rays` hit a virtual object
    Bool caught;     // `catcher_rays` hit a catcher that no virtual object or occluder hides
};

// Catchers do not hide the virtual objects behind them; occluders hide everything. `near`: the lanes that may meet a
// virtual object or an occluder.
ARHOST_INLINE PrimaryHits trace_primary(const Scene &scene, Vec3 eye, Vec3 direction, Bool active, Bool near) {
    PrimaryHits hits;
    near = near & active;
    Bool hit = bool_of(false), occluded = bool_of(false);
    if (any(near)) {
        set_ray(hits.rays.ray, eye, direction, Float(far_away), Int(virtual_masks | occluder_mask), Int(ray_of_eye));
        hit = trace(scene, scene.root, make_query(Coherence::coherent), hits.rays, near);
    }
    if (scene.has_occluders && any(hit))
        for_each_object(scene, hits.rays.hit, hit, [&](const Object &object, Bool here) {
            if (object.role == ARHOST_ROLE_OCCLUDER)
                occluded = occluded | here;
        });
    hits.is_virtual = hit & ~occluded;
    hits.caught = bool_of(false);
    const Bool rest = active & ~hits.is_virtual;
    if (scene.has_catchers && any(rest)) {
        Float end(far_away);
        if (any(hit))
            end = select(hit, load(hits.rays.ray.tfar), end);
        set_ray(hits.catcher_rays.ray, eye, direction, end, Int(catcher_mask));
        hits.caught = trace(scene, scene.catchers, make_query(Coherence::coherent, true), hits.catcher_rays, rest);
    }
    return hits;
}
