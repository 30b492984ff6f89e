// SPDX-License-Identifier: Apache-2.0
//
// Blending in linear light, and conversions of linear images (arhost/raytracer.h).
#pragma once

#include <arhost-cpp/linear_pixel.hpp>
#include <arhost/shading/srgb8.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace arhost {

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
