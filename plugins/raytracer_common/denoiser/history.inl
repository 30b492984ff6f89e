// SPDX-License-Identifier: Apache-2.0
//
// Where the history of the denoiser has the surfaces of this frame.
#pragma once
#include "raytracer_common/denoiser/layers.inl"
#include "raytracer_common/packets/video.inl"

// Normals with 10 bits per component.
ARHOST_INLINE Int packed_normal(Vec3 n) {
    const auto bits = [](Float a) __attribute__((always_inline)) {
        return to_int(a * Float(511.0f) + Float(512.0f));
    };
    return bits(n.x) | (bits(n.y) << Int(10)) | (bits(n.z) << Int(20));
}
ARHOST_INLINE Vec3 unpacked_normal(Int a) {
    const auto value = [](Int bits) __attribute__((always_inline)) {
        return (to_float(bits & Int(1023)) - Float(511.5f)) * Float(1.0f / 511);
    };
    return {value(a), value(a >> Int(10)), value(a >> Int(20))};
}

// The pixel of an image that shows a point.
struct Projected {
    Float x, y;     // px, pixel centres at integers
    Float distance; // mm, from the camera
    Bool inside;    // in front of the camera
};
ARHOST_INLINE Projected projected(const Denoising &denoising, const Camera &camera, Vec3 position) {
    const Vec3 to_point = position - splat(camera.eye);
    const PixelOf pixel = pixel_towards(denoising.video, camera, to_point);
    // From texels of the video to pixels of the image.
    const Texture &video = denoising.video.image;
    const Layer &pixels = denoising.objects;
    const float across = static_cast<float>(pixels.width) / static_cast<float>(video.width),
                down = static_cast<float>(pixels.height) / static_cast<float>(video.height);
    return {pixel.x * Float(across) - Float(0.5f), pixel.y * Float(down) - Float(0.5f), length(to_point),
            pixel.in_front};
}

// Points of this frame, as they were in the previous one.
struct PastPoints {
    Vec3 position, normal;
};
ARHOST_INLINE PastPoints points_before(const Denoising &denoising, Vec3 position, Vec3 normal, Int surface,
                                       Bool active) {
    if (!denoising.before_from_now)
        return {position, normal};
    const Int first = select(active, object_of_surface(surface) * Int(12), Int(0));
    const auto column = [&](int i) __attribute__((always_inline)) {
        const float *table = denoising.before_from_now + 3 * i;
        return Vec3{gather(table, first), gather(table + 1, first), gather(table + 2, first)};
    };
    const Vec3 columns[] = {column(0), column(1), column(2), column(3)};
    return {columns[0] * position.x + columns[1] * position.y + columns[2] * position.z + columns[3],
            columns[0] * normal.x + columns[1] * normal.y + columns[2] * normal.z};
}

// Calls use(cell, share, lanes) for up to four cells of the history around a point of the layer, which had these
// surfaces. The shares of a lane are positive; their sum is at most 1. `x`, `y`: cells, cell centres at integers.
template <class Use>
ARHOST_INLINE void for_each_past_cell(const Layer &layer, Float x, Float y, Float distance, Vec3 normal, Int surface,
                                      Bool active, Use use) {
    const Float left = floor(max(min(x + Float(1.0f / 64), Float(1e6f)), Float(-2.0f))),
                top = floor(max(min(y + Float(1.0f / 64), Float(1e6f)), Float(-2.0f)));
    const Float along = max(x - left, Float(0.0f)), down = max(y - top, Float(0.0f));
    for (int i = 0; i < 4; ++i) {
        const Int column = to_int(left) + Int(i & 1), line = to_int(top) + Int(i >> 1);
        const Float weight = (i & 1 ? along : Float(1.0f) - along) * (i >> 1 ? down : Float(1.0f) - down);
        Bool here = active & (Int(-1) < column) & (column < Int(layer.width)) & (Int(-1) < line) &
                    (line < Int(layer.height)) & (weight > Float(0.01f));
        const Int cell = select(here, line * Int(layer.stride) + column, Int(0));
        here = here & (bits_of(gather(layer.before[surface_history], cell)) == surface) &
               (abs(gather(layer.before[distance_history], cell) - distance) < distance * Float(0.03f)) &
               (dot(unpacked_normal(bits_of(gather(layer.before[normal_history], cell))), normal) > Float(0.8f));
        if (any(here))
            use(cell, select(here, weight, Float(0.0f)), here);
    }
}
