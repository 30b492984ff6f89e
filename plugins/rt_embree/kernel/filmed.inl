// SPDX-License-Identifier: Apache-2.0
//
// The light of real surfaces and surroundings that the video shows, or has shown (Surroundings in kernel.hpp).
#pragma once
#include "path_lights.inl"

#include "raytracer_common/packets/video.inl"

// Above this, the video is saturated: the light may be brighter.
constexpr float saturated_video = 0.95f;

// The light of the video in some direction.
struct Filmed {
    Bool inside; // the video shows this direction
    Vec3 light;
};
// `to_point`: from the camera's eye, in world axes.
ARHOST_INLINE Filmed filmed_towards(const Frame &frame, Vec3 to_point) {
    const Video &video = frame.path.video;
    const PixelOf pixel = pixel_towards(video, frame.camera, to_point);
    const Float x = pixel.x, y = pixel.y;
    const Float width(static_cast<float>(video.image.width)), height(static_cast<float>(video.image.height));
    const Bool inside = pixel.in_front & (x > Float(0.0f)) & (x < width) & (y > Float(0.0f)) & (y < height);
    if (!video.image.texels || !any(inside))
        return {bool_of(false), black()};
    return {inside, sample_texture(video.linear_of_srgb8, video.image, x / width, y / height).colour};
}

// As filmed_surface(), of the present only. `offset`: mm.
ARHOST_INLINE Filmed filmed_now(const Frame &frame, Vec3 position, Vec3 geometric_normal, Float offset, Bool active) {
    if (!frame.path.video.image.texels || !any(active))
        return {bool_of(false), black()};
    const Vec3 eye = splat(frame.camera.eye), to_point = position - eye;
    Filmed filmed = filmed_towards(frame, to_point);
    // The video shows the side of the surface that faces the camera.
    filmed.inside = active & filmed.inside & (dot(geometric_normal, to_point) < Float(0.0f));
    if (frame.scene.has_several_real && any(filmed.inside)) { // the video shows a nearer real surface
        RTCRay16 ray;
        const Float end = Float(1.0f) - offset * Float(4.0f) / max(length(to_point), Float(1e-20f));
        set_ray(ray, eye, to_point, end, Int(real_masks));
        filmed.inside = filmed.inside & ~blocked(frame.scene, ray, filmed.inside);
    }
    return filmed;
}

// The light that the video has shown, and how certain it still is, from 0 to 1.
struct Remembered {
    Vec3 light;
    Float certainty;
};
// `x`, `y`: texel centres at halves. `first`, `height`: rows of Surroundings.
ARHOST_INLINE Remembered remembered_at(const Surroundings &from, Float x, Float y, int first, int height, bool wraps,
                                       Bool active) {
    Remembered sum{black(), Float(0.0f)};
    if (!from.before[0])
        return sum;
    const Float left = floor(x - Float(0.5f)), top = floor(y - Float(0.5f));
    const Float along = x - Float(0.5f) - left, down = y - Float(0.5f) - top;
    const auto limited = [](Float a, int size) __attribute__((always_inline)) {
        return to_int(min(max(a, Float(0.0f)), Float(static_cast<float>(size - 1))));
    };
    for (int i = 0; i < 4; ++i) {
        const Float column = left + Float(static_cast<float>(i & 1));
        const Int texel_column =
            wraps ? to_int(column) & Int(Surroundings::width - 1) : limited(column, Surroundings::width);
        const Int row = limited(top + Float(static_cast<float>(i >> 1)), height) + Int(first);
        const Int texel = select(active, row * Int(Surroundings::width) + texel_column, Int(0));
        const Float weight = (i & 1 ? along : Float(1.0f) - along) * (i >> 1 ? down : Float(1.0f) - down) *
                             gather(from.before[Surroundings::certainty_row], texel);
        const Vec3 light{gather(from.before[0], texel), gather(from.before[1], texel), gather(from.before[2], texel)};
        sum.light = sum.light + light * weight;
        sum.certainty = sum.certainty + weight;
    }
    sum.certainty = select(active, sum.certainty, Float(0.0f));
    sum.light = sum.light * (Float(1.0f) / max(sum.certainty, Float(1e-6f)));
    return sum;
}
ARHOST_INLINE Remembered remembered_towards(const Surroundings &from, Vec3 direction, Bool active) {
    constexpr int height = Surroundings::height - Surroundings::plane_height;
    const Vec3 d = normalize(direction);
    return remembered_at(from, equirectangular_u(d) * Float(static_cast<float>(Surroundings::width)),
                         equirectangular_v(d) * Float(static_cast<float>(height)), Surroundings::plane_height, height,
                         true, active);
}
// Of points of the flat catcher.
ARHOST_INLINE Remembered remembered_on_plane(const Surroundings &from, Vec3 position, Bool active) {
    const auto texel = [&](int i) __attribute__((always_inline)) {
        const int axis = from.axes[i];
        const Float at = axis == 0 ? position.x : axis == 1 ? position.y : position.z;
        return (at - Float(from.low[i])) * Float(1 / from.texel_mm[i]);
    };
    if (!from.knows_plane)
        return {black(), Float(0.0f)};
    const Float x = texel(0), y = texel(1);
    const Bool inside = active & (x > Float(0.0f)) & (x < Float(static_cast<float>(Surroundings::width))) &
                        (y > Float(0.0f)) & (y < Float(static_cast<float>(Surroundings::plane_height)));
    return remembered_at(from, x, y, 0, Surroundings::plane_height, false, inside);
}

// Returns the light of real surfaces that the video shows or has shown. `inside`: the lanes in which it does. What is
// remembered fades into the light of the surface's material.
ARHOST_INLINE Filmed filmed_surface(const Frame &frame, const RTCHit16 &hit, const Surface &s, Bool active) {
    Filmed filmed = filmed_now(frame, s.position, s.geometric_normal, s.offset, active);
    if (!frame.surroundings)
        return filmed;
    const Surroundings &surroundings = *frame.surroundings;
    const int axis = surroundings.normal_axis();
    const Vec3 n = s.geometric_normal;
    const Float facing = (axis == 0 ? n.x : axis == 1 ? n.y : n.z) * Float(surroundings.side);
    const Bool outside = active & ~filmed.inside & (facing > Float(0.0f)) &
                         (object_number(frame.scene, hit) == Int(surroundings.catcher));
    if (!any(outside))
        return filmed;
    const Remembered remembered = remembered_on_plane(surroundings, s.position, outside);
    const Bool known = outside & (remembered.certainty > Float(Surroundings::least_certainty));
    if (!any(known))
        return filmed;
    const Vec3 unknown = s.emission + s.diffuse * irradiance_without_objects(frame, s);
    const Vec3 light = unknown + (remembered.light - unknown) * remembered.certainty;
    return {filmed.inside | known, select(known, light, filmed.light)};
}

// Updates a row of Frame::surroundings with the video.
ARHOST_INLINE void remember(const Frame &frame, std::int32_t row) {
    const Surroundings &surroundings = *frame.surroundings;
    const bool of_plane = row < Surroundings::plane_height;
    for (int x = 0; x < Surroundings::width; x += lanes) {
        const Float column = to_float(lane_numbers() + Int(x)) + Float(0.5f);
        Filmed filmed{bool_of(false), black()};
        Bool is_lamp = bool_of(false);
        if (of_plane && surroundings.catcher >= 0) {
            Float position[3];
            position[surroundings.axes[0]] = Float(surroundings.low[0]) + column * Float(surroundings.texel_mm[0]);
            position[surroundings.axes[1]] =
                Float(surroundings.low[1] + (static_cast<float>(row) + 0.5f) * surroundings.texel_mm[1]);
            const int normal_axis = surroundings.normal_axis();
            position[normal_axis] = Float(surroundings.plane_mm);
            const auto component = [&](int axis) { return Float(axis == normal_axis ? surroundings.side : 0.0f); };
            filmed =
                filmed_now(frame, {position[0], position[1], position[2]}, {component(0), component(1), component(2)},
                           Float(surroundings.texel_mm[0] * 1e-3f), bool_of(true));
        } else if (!of_plane) {
            constexpr float height = Surroundings::height - Surroundings::plane_height;
            const float v = (static_cast<float>(row - Surroundings::plane_height) + 0.5f) / height;
            const Vec3 direction = equirectangular_direction(column * Float(1.0f / Surroundings::width), Float(v));
            filmed = filmed_towards(frame, direction);
            // A texel that contains a lamp is not remembered: the environment shows how bright it is.
            for (int corner = 0; corner < 4 && any(filmed.inside); ++corner) {
                const float beside = corner & 1 ? 0.3f : -0.3f, above = corner & 2 ? 0.3f : -0.3f;
                const Vec3 towards = equirectangular_direction(
                    (column + Float(beside)) * Float(1.0f / Surroundings::width), Float(v + above / height));
                is_lamp = is_lamp | (largest(filmed_towards(frame, towards).light) >= Float(saturated_video));
            }
            is_lamp = filmed.inside & (is_lamp | (largest(filmed.light) >= Float(saturated_video)));
            filmed.inside = filmed.inside & ~is_lamp;
            if (any(filmed.inside)) {
                RTCRay16 ray;
                set_ray(ray, splat(frame.camera.eye), direction, Float(far_away), Int(real_masks));
                filmed.inside = filmed.inside & ~blocked(frame.scene, ray, filmed.inside);
            }
        }
        const std::ptrdiff_t at = std::ptrdiff_t{Surroundings::width} * row + x;
        Vec3 light = black();
        Float certainty(0.0f);
        if (surroundings.before[0] && (surroundings.knows_plane || !of_plane)) {
            light = {load(surroundings.before[0] + at), load(surroundings.before[1] + at),
                     load(surroundings.before[2] + at)};
            certainty = load(surroundings.before[Surroundings::certainty_row] + at);
        }
        // The mean of a few frames has less noise of the camera.
        const Float share = select(certainty > Float(0.5f), Float(0.25f), Float(1.0f));
        light = select(filmed.inside, light + (filmed.light - light) * share, light);
        certainty = select(filmed.inside, Float(1.0f), certainty * Float(Surroundings::kept_per_frame));
        certainty = select(is_lamp, Float(0.0f), certainty);
        store(surroundings.after[0] + at, light.x);
        store(surroundings.after[1] + at, light.y);
        store(surroundings.after[2] + at, light.z);
        store(surroundings.after[Surroundings::certainty_row] + at, certainty);
    }
}
