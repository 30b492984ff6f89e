// SPDX-License-Identifier: Apache-2.0
//
// The pixels of linear images (arhost/raytracer.h), and blending in linear light.
#pragma once

#include <arhost/shading/srgb8.hpp>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>

namespace arhost {

// A pixel of an image of ARHOST_IMAGE_FORM_LINEAR; binary16 numbers.
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

// A weighted sum of pixels whose weights add up to 1; what is missing counts as untouched pixels.
class LinearSum {
public:
    void add(const LinearPixel &pixel, float weight) {
        for (int c = 0; c < 3; ++c) {
            added_[c] += weight * float_of(pixel.added[c]);
            removed_[c] += weight * (1 - float_of(pixel.transmittance[c]));
        }
    }
    LinearPixel pixel() const {
        LinearPixel pixel{};
        for (int c = 0; c < 3; ++c) {
            pixel.added[c] = half_of(added_[c]);
            pixel.transmittance[c] = half_of(std::max(0.0f, 1 - removed_[c]));
        }
        return pixel;
    }

private:
    float added_[3] = {}, removed_[3] = {};
};

// sRGB code → linear light, and back with exact rounding.
struct LightTables {
    LightTables();
    float light_of[256];
    shading::Srgb8Table code_of; // NaN and negative numbers become 0, infinity 255
};
const LightTables &light_tables();

// Returns the code that the host shows for one channel of a linear pixel that is not untouched, over video of the
// code `video`.
inline std::uint8_t added_and_transmitted(std::uint16_t added, std::uint16_t transmittance, std::uint8_t video) {
    const LightTables &tables = light_tables();
    return static_cast<std::uint8_t>(
        tables.code_of(float_of(added) + float_of(transmittance) * tables.light_of[video]));
}

// Blends `count` straight pixels `rgba` over `bgr` in linear light: exactly the video where alpha is 0, exactly the
// overlay where it is 255. `out` may be `bgr`.
void blend_in_linear_light(const std::uint8_t *bgr, const std::uint8_t *rgba, std::uint8_t *out, std::size_t count);

// Converts `count` pixels to straight RGBA8. Alpha is the mean light that the pixel removes from the video
// (shading::overlay_alpha), and the colour added / alpha. Straight pixels cannot represent light that is added where
// nothing is removed, as on a catcher, nor coloured shadows: the former is lost, the latter become grey.
void straight_from_linear(const std::uint16_t *linear, std::uint8_t *rgba, std::size_t count);

} // namespace arhost
