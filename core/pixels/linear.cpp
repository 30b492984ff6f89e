// SPDX-License-Identifier: Apache-2.0
#include "pixels/linear.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace arhost {

LightTables::LightTables() : code_of(shading::make_srgb8_table()) {
    for (int code = 0; code < 256; ++code)
        light_of[code] = static_cast<float>(shading::srgb_decode(code / 255.0));
}

const LightTables &light_tables() {
    static const LightTables tables;
    return tables;
}

void blend_in_linear_light(const std::uint8_t *bgr, const std::uint8_t *rgba, std::uint8_t *out, std::size_t count) {
    const LightTables &tables = light_tables();
    for (std::size_t i = 0; i < count; ++i, bgr += 3, rgba += 4, out += 3) {
        const std::uint8_t alpha = rgba[3];
        if (alpha == 0) {
            std::memmove(out, bgr, 3);
            continue;
        }
        const float share = static_cast<float>(alpha) / 255;
        for (int c = 0; c < 3; ++c)
            out[c] = alpha == 255 ? rgba[2 - c]
                                  : static_cast<std::uint8_t>(tables.code_of(share * tables.light_of[rgba[2 - c]] +
                                                                             (1 - share) * tables.light_of[bgr[c]]));
    }
}

void straight_from_linear(const std::uint16_t *linear, std::uint8_t *rgba, std::size_t count) {
    const LightTables &tables = light_tables();
    for (std::size_t i = 0; i < count; ++i, rgba += 4) {
        LinearPixel pixel;
        std::memcpy(&pixel, linear + 8 * i, sizeof pixel);
        std::memset(rgba, 0, 4);
        if (pixel == untouched)
            continue;
        const auto light = [&](int c) { return static_cast<double>(float_of(pixel.transmittance[c])); };
        const double alpha = shading::overlay_alpha({light(0), light(1), light(2)});
        if (!(alpha > 0)) // also for a NaN of an untrusted worker
            continue;
        for (int c = 0; c < 3; ++c)
            rgba[c] = static_cast<std::uint8_t>(
                tables.code_of(static_cast<float>(shading::overlay_colour(float_of(pixel.added[c]), alpha))));
        rgba[3] = static_cast<std::uint8_t>(std::lround(255 * std::min(alpha, 1.0)));
    }
}

} // namespace arhost
