// SPDX-License-Identifier: Apache-2.0
//
// The pixels of images of ARHOST_IMAGE_FORM_LINEAR (arhost/raytracer.h).
#pragma once

#include <arhost/raytracer.h>

#include <bit>
#include <cstddef>
#include <cstdint>

namespace arhost {

// Binary16 numbers.
struct LinearPixel {
    std::uint16_t added[3], reserved_0, transmittance[3], reserved_1;
    bool operator==(const LinearPixel &) const = default;
};
static_assert(sizeof(LinearPixel) == 16);

constexpr std::uint16_t half_of_one = 0x3c00;
// A pixel that virtual objects do not affect.
constexpr LinearPixel untouched{{0, 0, 0}, 0, {half_of_one, half_of_one, half_of_one}, 0};

constexpr float float_of(std::uint16_t half) {
    const std::uint32_t sign = std::uint32_t{half & 0x8000u} << 16, magnitude = half & 0x7fffu;
    std::uint32_t bits = (magnitude << 13) + ((127 - 15) << 23);
    if (magnitude >= 0x7c00)
        bits = 0x7f800000 | magnitude << 13; // infinity or NaN
    else if (magnitude < 0x0400)
        bits = std::bit_cast<std::uint32_t>(static_cast<float>(magnitude) * 0x1p-24f);
    return std::bit_cast<float>(sign | bits);
}

// Rounds to nearest, ties to even. Numbers that are too large become infinite.
constexpr std::uint16_t half_of(float number) {
    const auto all = std::bit_cast<std::uint32_t>(number);
    const std::uint32_t sign = all >> 16 & 0x8000, bits = all & 0x7fffffff;
    std::uint32_t half = 0x7e00; // NaN
    if (bits < (127 - 14) << 23) // the sum's last bit is that of a subnormal half
        half = std::bit_cast<std::uint32_t>(std::bit_cast<float>(bits) + 0.5f) - std::bit_cast<std::uint32_t>(0.5f);
    else if (bits <= 0x7f800000)
        half = bits >= 0x477ff000 ? 0x7c00 : (bits + 0xfff + (bits >> 13 & 1) - ((127 - 15) << 23)) >> 13;
    return static_cast<std::uint16_t>(sign | half);
}

// `transmittance`: the share of the video that stays visible, 0 on virtual objects.
constexpr LinearPixel linear_pixel(const float (&added)[3], const float (&transmittance)[3]) {
    LinearPixel pixel{};
    for (int channel = 0; channel < 3; ++channel) {
        pixel.added[channel] = half_of(added[channel]);
        pixel.transmittance[channel] = half_of(transmittance[channel]);
    }
    return pixel;
}

// The pixels of a row; nullptr if the form is not ARHOST_IMAGE_FORM_LINEAR.
inline LinearPixel *linear_row(const arhost_image &image, std::uint32_t row) {
    return reinterpret_cast<LinearPixel *>(image.linear ? image.linear + std::size_t{image.stride} / 2 * row
                                                        : nullptr);
}

} // namespace arhost
