// SPDX-License-Identifier: Apache-2.0
//
// Pixels of images.
#pragma once
#include "raytracer_common/packets/video.inl"

constexpr int block = 4; // side of a block, px

// Returns the lanes of a block whose pixels are inside the image.
ARHOST_INLINE Bool inside_block(int width, int height) {
    return ((lane_numbers() & Int(block - 1)) < Int(width)) & ((lane_numbers() >> Int(2)) < Int(height));
}

ARHOST_INLINE Int srgb8(const arhost::shading::Srgb8Table &table, Float linear) {
    using Table = arhost::shading::Srgb8Table;
    const Int bits = bits_of(min(max(linear, Float(Table::smallest)), Float(1.0f)));
    const Int cell = gather(table.cells, (bits - Int(Table::first_bits)) >> Int(Table::shift));
    const Bool above = (bits & Int(Table::low_mask)) >= (cell & Int(Table::threshold_mask));
    return (cell >> Int(Table::code_shift)) + select(above, Int(1), Int(0));
}

ARHOST_INLINE Int rgba8(Int r, Int g, Int b, Int a) {
    return r | (g << Int(8)) | (b << Int(16)) | (a << Int(24));
}

// Returns the bits of a half-precision float, rounded to nearest, ties to even. `a`: 0 to 65504.
ARHOST_INLINE Int half_of(Float a) {
    const Int bits = bits_of(a), odd = shift_right_unsigned(bits, 13) & Int(1);
    const Int normal = shift_right_unsigned(bits + Int(0xfff) + odd, 13) - Int(112 << 10);
    // Adding ½ shifts the bits of a subnormal half to the end of the mantissa.
    const Int subnormal = bits_of(a + Float(0.5f)) - Int(126 << 23);
    return select(a < Float(0x1p-14f), subnormal, normal);
}

// The overlay of a block: added light and transmittance.
struct LinearBlock {
    Vec3 added, transmittance;
};

// Removes the light that catchers mirror only without virtual objects. It is part of the video, so that the
// transmittance applies to it, too. A saturated video shows less than that; there, the catcher's diffuse light
// remains. `covered`, `matt`: means over the samples that hit no virtual object: the light that
// catchers mirror only without virtual objects, and their diffuse light without them. `column`, `row`: as in
// video_at().
ARHOST_INLINE void remove_covered(const Video &video_under, Vec3 covered, Vec3 matt, Float column, Float row,
                                  LinearBlock &linear) {
    if (!any(largest(covered) > Float(0.0f)))
        return;
    if (!video_under.image.texels) {
        linear.added = linear.added - linear.transmittance * covered;
        return;
    }
    const Vec3 video = video_at(video_under, column, row);
    const auto remaining = [](Float part, Float diffuse, Float whole) __attribute__((always_inline)) {
        const Float saturated = min(max(whole * Float(5.0f) - Float(4.0f), Float(0.0f)), Float(1.0f)); // from 0.8 on
        const Float least = min(diffuse * saturated / max(whole, Float(1e-6f)), Float(1.0f));
        return max(Float(1.0f) - part / max(whole, Float(1e-6f)), least);
    };
    linear.transmittance =
        linear.transmittance * Vec3{remaining(covered.x, matt.x, video.x), remaining(covered.y, matt.y, video.y),
                                    remaining(covered.z, matt.z, video.z)};
}

ARHOST_INLINE Vec3 bounded_for_halves(Vec3 a) {
    const auto bounded = [](Float value) __attribute__((always_inline)) {
        return min(max(value, Float(0.0f)), Float(65504.0f));
    };
    return {bounded(a.x), bounded(a.y), bounded(a.z)};
}

// Writes a block of the image. Returns whether virtual objects affect any of its pixels.
ARHOST_INLINE bool write_linear(const Image &image, int x, int y, int width, int height, const LinearBlock &block_of,
                                int lanes_per_row = block) {
    alignas(64) int halves[6][lanes];
    const Float values[] = {block_of.added.x,         block_of.added.y,         block_of.added.z,
                            block_of.transmittance.x, block_of.transmittance.y, block_of.transmittance.z};
    Bool affected = bool_of(false);
    for (int i = 0; i < 6; ++i) {
        const Int bits = half_of(values[i]);
        affected = affected | (bits != Int(i < 3 ? 0 : 0x3c00));
        store(halves[i], bits);
    }
    for (int row = 0; row < height; ++row) {
        auto *to = reinterpret_cast<std::uint16_t *>(reinterpret_cast<std::uint8_t *>(image.linear) +
                                                     std::size_t{image.stride} * (y + row)) +
                   std::size_t{8} * x;
        for (int column = 0; column < width; ++column, to += 8)
            for (int i = 0; i < 3; ++i) {
                to[i] = static_cast<std::uint16_t>(halves[i][lanes_per_row * row + column]);
                to[4 + i] = static_cast<std::uint16_t>(halves[3 + i][lanes_per_row * row + column]);
                to[3] = to[7] = 0;
            }
    }
    return any(affected & (lanes_per_row == block ? inside_block(width, height) : lane_numbers() < Int(width)));
}

ARHOST_INLINE Int straight_of(const Image &image, const LinearBlock &linear) {
    const Float removed = overlay_alpha(linear.transmittance);
    const Float alpha = image.blends_codes ? alpha_of_light(Float(1.0f) - removed) : removed;
    const Vec3 colour = linear.added * (Float(1.0f) / max(alpha, Float(1e-6f)));
    const arhost::shading::Srgb8Table &table = *image.srgb8;
    return rgba8(srgb8(table, colour.x), srgb8(table, colour.y), srgb8(table, colour.z), to_int(code_8bit(alpha)));
}
