// SPDX-License-Identifier: Apache-2.0
//
// Access to the layers of the denoiser.
#pragma once
#include "raytracer_common/packets/vectors.inl"

ARHOST_INLINE Vec3 load3(const float *const *rows, std::ptrdiff_t at) {
    return {load(rows[0] + at), load(rows[1] + at), load(rows[2] + at)};
}
ARHOST_INLINE void store3(float *const *rows, std::ptrdiff_t at, Vec3 a) {
    store(rows[0] + at, a.x);
    store(rows[1] + at, a.y);
    store(rows[2] + at, a.z);
}
ARHOST_INLINE Vec3 gather3(const float *const *rows, Int at) {
    return {gather(rows[0], at), gather(rows[1], at), gather(rows[2], at)};
}

// Index of a cell in guides and light, and in histories.
ARHOST_INLINE std::ptrdiff_t guide_at(const Layer &layer, int x, int y) {
    return std::ptrdiff_t{y} * layer.guide_stride() + Layer::margin + x;
}
ARHOST_INLINE std::ptrdiff_t history_at(const Layer &layer, int x, int y) {
    return std::ptrdiff_t{y} * layer.stride + x;
}
ARHOST_INLINE Int surfaces_at(const Layer &layer, std::ptrdiff_t at) {
    return bits_of(load(layer.guides[surface_guide] + at));
}

// As the scalar surface_number().
ARHOST_INLINE Int surface_number(Int object, Int kind) {
    return ((object + Int(1)) << Int(2)) | kind;
}
ARHOST_INLINE Int object_of_surface(Int surface) {
    return ((surface & Int(mirrored_unit - 1)) >> Int(2)) - Int(1);
}
ARHOST_INLINE Bool is_kind(Int surface, SurfaceKind kind) {
    return (surface & Int(3)) == Int(kind);
}

// Returns the lanes whose surfaces have light in the layer.
ARHOST_INLINE Bool has_light_in(const Layer &layer, Int surface) {
    const Bool is_real = is_kind(surface, real_surface);
    return layer.holds == LayerLight::objects ? ~is_real & (surface != Int(0))
                                              : is_real & (surface != Int(unchanged_surface));
}

// A pixel at an edge has eight rays. Four bits for each tell which light it gets: that of one of the nine pixels
// around (3 · (dy + 1) + dx + 1), or none.
constexpr int tap_count = 8, own_tap = 4, no_tap = 15;
constexpr unsigned only_own = 0x44444444;
