// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "raytracer_common/packets/vectors.inl"

// Linear colour and alpha.
struct Texel {
    Vec3 colour;
    Float alpha;
};

// Maps the texel index `i`, which may be outside the texture, to an index inside it.
ARHOST_INLINE Int wrapped(Int i, Int size, arhost_wrap wrap) {
    const Int last = size - Int(1), zero(0);
    if (wrap == ARHOST_WRAP_CLAMP)
        return select(i < zero, zero, select(i >= size, last, i));
    // Computes i mod `period` in float arithmetic. The result is exact: textures have at most 2^14 texels a side, and
    // sample_texture() has already reduced the coordinate.
    const Int period = wrap == ARHOST_WRAP_MIRROR ? size + size : size;
    const Int times = to_int(floor((to_float(i) + Float(0.5f)) * (Float(1.0f) / to_float(period))));
    const Int within = i - times * period;
    if (wrap == ARHOST_WRAP_MIRROR)
        return select(within >= size, period - Int(1) - within, within);
    return within;
}

// The level of an image that a lane reads: the index of its first texel, and its size.
struct ImageLevel {
    Int first, width, height;
};

ARHOST_INLINE Texel texel_at(const float *linear_of_srgb8, const Texture &texture, const ImageLevel &level, Int x,
                             Int y) {
    const Int at = level.first + y * level.width + x;
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

ARHOST_INLINE Texel mix(Texel a, Texel b, Float t) {
    return {a.colour + (b.colour - a.colour) * t, a.alpha + (b.alpha - a.alpha) * t};
}

ARHOST_INLINE Texel sample_level(const float *linear_of_srgb8, const Texture &texture, const ImageLevel &level,
                                 Float u, Float v) {
    // Reduces a coordinate to an equivalent one near 0: the texel index must fit an int, and the float must retain
    // its fraction.
    const auto reduced = [](Float t, arhost_wrap wrap) __attribute__((always_inline)) {
        if (wrap == ARHOST_WRAP_CLAMP)
            return min(max(t, Float(-1.0f)), Float(2.0f));
        const Float bounded = min(max(t, Float(-1e6f)), Float(1e6f));
        return bounded - Float(2.0f) * floor(bounded * Float(0.5f));
    };
    const float half = texture.is_nearest ? 0.0f : 0.5f;
    const Float x = reduced(u, texture.wrap_u) * to_float(level.width) - Float(half);
    const Float y = reduced(v, texture.wrap_v) * to_float(level.height) - Float(half);
    const Float left = floor(x), top = floor(y), tx = x - left, ty = y - top;
    const Int x0 = wrapped(to_int(left), level.width, texture.wrap_u);
    const Int y0 = wrapped(to_int(top), level.height, texture.wrap_v);
    if (texture.is_nearest)
        return texel_at(linear_of_srgb8, texture, level, x0, y0);
    const Int x1 = wrapped(to_int(left) + Int(1), level.width, texture.wrap_u);
    const Int y1 = wrapped(to_int(top) + Int(1), level.height, texture.wrap_v);
    const auto texel = [&](Int x, Int y) __attribute__((always_inline)) {
        return texel_at(linear_of_srgb8, texture, level, x, y);
    };
    return mix(mix(texel(x0, y0), texel(x1, y0), tx), mix(texel(x0, y1), texel(x1, y1), tx), ty);
}

// Samples a texture with its filter. `linear_of_srgb8`: linear value of each of the 256 sRGB codes; `area`: that a
// sample covers, in the unit of u times that of v. Interpolates between the levels with smaller and with larger
// texels (T. Akenine-Möller et al., Texture Level of Detail Strategies for Real-Time Ray Tracing, Ray Tracing Gems,
// 2019).
ARHOST_INLINE Texel sample_texture(const float *linear_of_srgb8, const Texture &texture, Float u, Float v,
                                   Float area) {
    ImageLevel level{Int(0), Int(texture.width), Int(texture.height)};
    const Float texels = area * Float(static_cast<float>(texture.width) * static_cast<float>(texture.height));
    if (texture.level_count == 1 || !any(texels > Float(1.0f)))
        return sample_level(linear_of_srgb8, texture, level, u, v);
    const Float number = min(Float(0.5f) * log2(min(max(texels, Float(1.0f)), Float(1e30f))),
                             Float(static_cast<float>(texture.level_count - 1)));
    const Float lower = floor(number);
    const Int last(texture.level_count - 1);
    const auto level_of = [&](Int n) __attribute__((always_inline)) {
        const auto side = [&](std::int32_t of_image) __attribute__((always_inline)) {
            const Int shifted = Int(of_image) >> n;
            return select(shifted < Int(1), Int(1), shifted);
        };
        return ImageLevel{gather(texture.first_of_level, n), side(texture.width), side(texture.height)};
    };
    const Int n = to_int(lower), next = n + Int(1);
    return mix(sample_level(linear_of_srgb8, texture, level_of(n), u, v),
               sample_level(linear_of_srgb8, texture, level_of(select(next < last, next, last)), u, v),
               number - lower);
}

// Samples the largest level.
ARHOST_INLINE Texel sample_texture(const float *linear_of_srgb8, const Texture &texture, Float u, Float v) {
    return sample_level(linear_of_srgb8, texture, {Int(0), Int(texture.width), Int(texture.height)}, u, v);
}
