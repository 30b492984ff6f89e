// SPDX-License-Identifier: Apache-2.0
//
// The light of each code of the grey plane.
#pragma once

#include <arhost/frame.h>
#include <arhost/shading/scalar.hpp>

#include <array>
#include <numeric>

namespace arhost::fiducial {

using LightOfCode = std::array<float, 256>; // 0 to 255

inline const LightOfCode &light_of_code(arhost_transfer transfer) {
    static const LightOfCode linear = [] {
        LightOfCode light;
        std::iota(light.begin(), light.end(), 0.0F);
        return light;
    }();
    static const LightOfCode srgb = [] {
        LightOfCode light;
        for (int code = 0; code < 256; ++code)
            light[code] = static_cast<float>(255 * shading::srgb_decode(code / 255.0));
        return light;
    }();
    return transfer == ARHOST_TRANSFER_LINEAR ? linear : srgb;
}

} // namespace arhost::fiducial
