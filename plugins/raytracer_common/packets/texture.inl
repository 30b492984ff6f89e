// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "raytracer_common/packets/vectors.inl"

// Linear colour and alpha.
struct Texel {
    Vec3 colour;
    Float alpha;
};

// Maps the texel index `i`, which may be outside the texture, to an index inside it.
ARHOST_INLINE Int wrapped(Int i, std::int32_t size, arhost_wrap wrap) {
    const Int last(size - 1), zero(0);
    if (wrap == ARHOST_WRAP_CLAMP)
        return select(i < zero, zero, select(i >= Int(size), last, i));
    // Computes i mod `period` in float arithmetic. The result is exact: textures have at most 2^14 texels a side, and
    // sample_texture() has already reduced the coordinate.
    const int period = wrap == ARHOST_WRAP_MIRROR ? 2 * size : size;
    const Int times = to_int(floor((to_float(i) + Float(0.5f)) * Float(1.0f / static_cast<float>(period))));
    const Int within = i - times * Int(period);
    if (wrap == ARHOST_WRAP_MIRROR)
        return select(within >= Int(size), Int(period - 1) - within, within);
    return within;
}

ARHOST_INLINE Texel texel_at(const float *linear_of_srgb8, const Texture &texture, Int x, Int y) {
    const Int at = y * Int(texture.width) + x;
    if (texture.format == ARHOST_TEXEL_RGBA32F) {
        const auto *from = static_cast<const float *>(texture.texels);
        const Int first = at << Int(2);
        return {{gather(from, first), gather(from + 1, first), gather(from + 2, first)}, gather(from + 3, first)};
    }
    const Int code = gather(static_cast<const int *>(texture.texels), at);
    const auto byte = [&](int number) __attribute__((always_inline)) {
        return shift_right_unsigned(code, 8 * number) & Int(255);
    };
    const Float alpha = to_float(byte(3)) * Float(1.0f / 255);
    if (texture.format == ARHOST_TEXEL_SRGB8)
        return {
            {gather(linear_of_srgb8, byte(0)), gather(linear_of_srgb8, byte(1)), gather(linear_of_srgb8, byte(2))},
            alpha};
    return {Vec3{to_float(byte(0)), to_float(byte(1)), to_float(byte(2))} * Float(1.0f / 255), alpha};
}

// Samples a texture with its filter. `linear_of_srgb8`: linear value of each of the 256 sRGB codes.
ARHOST_INLINE Texel sample_texture(const float *linear_of_srgb8, const Texture &texture, Float u, Float v) {
    // Reduces a coordinate to an equivalent one near 0: the texel index must fit an int, and the float must retain
    // its fraction.
    const auto reduced = [](Float t, arhost_wrap wrap) __attribute__((always_inline)) {
        if (wrap == ARHOST_WRAP_CLAMP)
            return min(max(t, Float(-1.0f)), Float(2.0f));
        const Float bounded = min(max(t, Float(-1e6f)), Float(1e6f));
        return bounded - Float(2.0f) * floor(bounded * Float(0.5f));
    };
    const float half = texture.is_nearest ? 0.0f : 0.5f;
    const Float x = reduced(u, texture.wrap_u) * Float(static_cast<float>(texture.width)) - Float(half);
    const Float y = reduced(v, texture.wrap_v) * Float(static_cast<float>(texture.height)) - Float(half);
    const Float left = floor(x), top = floor(y), tx = x - left, ty = y - top;
    const Int x0 = wrapped(to_int(left), texture.width, texture.wrap_u);
    const Int y0 = wrapped(to_int(top), texture.height, texture.wrap_v);
    if (texture.is_nearest)
        return texel_at(linear_of_srgb8, texture, x0, y0);
    const Int x1 = wrapped(to_int(left) + Int(1), texture.width, texture.wrap_u);
    const Int y1 = wrapped(to_int(top) + Int(1), texture.height, texture.wrap_v);
    const auto mix = [](Texel a, Texel b, Float t) __attribute__((always_inline)) {
        return Texel{a.colour + (b.colour - a.colour) * t, a.alpha + (b.alpha - a.alpha) * t};
    };
    return mix(mix(texel_at(linear_of_srgb8, texture, x0, y0), texel_at(linear_of_srgb8, texture, x1, y0), tx),
               mix(texel_at(linear_of_srgb8, texture, x0, y1), texel_at(linear_of_srgb8, texture, x1, y1), tx), ty);
}
