// SPDX-License-Identifier: Apache-2.0
#include "scene/default_light.hpp"

#include <glm/common.hpp>

#include <array>
#include <cmath>
#include <cstring>
#include <numbers>

namespace arhost::scene {

// The direction of the light is unknown. Of the lamps tried in tools/bench truth, one at the zenith with these shares
// is the best in the mean of the rooms.
TexelImage default_light() {
    constexpr std::uint32_t height = 64;
    constexpr double mean_reflectance = 0.35, share_of_lamp = 0.5;
    const double lamp_begin = std::cos(45 * std::numbers::pi / 180),
                 lamp_full = std::cos(25 * std::numbers::pi / 180);
    const auto lamp = [&](double cosine) { return glm::smoothstep(lamp_begin, lamp_full, cosine); };
    const auto cosine_of_row = [](std::uint32_t row) { return std::cos(std::numbers::pi * (row + 0.5) / height); };
    const auto solid_angle_of_row = [](std::uint32_t row) {
        return 2 * std::numbers::pi *
               (std::cos(std::numbers::pi * row / height) - std::cos(std::numbers::pi * (row + 1) / height));
    };
    double irradiance_of_lamp = 0; // divided by π, of a horizontal surface
    for (std::uint32_t row = 0; row < height / 2; ++row)
        irradiance_of_lamp +=
            lamp(cosine_of_row(row)) * cosine_of_row(row) * solid_angle_of_row(row) * std::numbers::inv_pi;

    TexelImage image{ARHOST_TEXEL_RGBA32F, 1, height, Texels::of_size(height * 4 * sizeof(float))};
    for (std::uint32_t row = 0; row < height; ++row) {
        const double cosine = cosine_of_row(row);
        const double above =
            (1 - share_of_lamp + share_of_lamp * lamp(cosine) / irradiance_of_lamp) / mean_reflectance;
        const auto radiance = static_cast<float>(glm::mix(1.0, above, glm::smoothstep(-0.1, 0.1, cosine)));
        const std::array texel{radiance, radiance, radiance, 1.0f};
        std::memcpy(image.texels.bytes.get() + row * sizeof texel, texel.data(), sizeof texel);
    }
    return image;
}

} // namespace arhost::scene
