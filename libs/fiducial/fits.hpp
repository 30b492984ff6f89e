// SPDX-License-Identifier: Apache-2.0
//
// Code shared by the fits of edges and of whole printed markers: linear light of codes, medians, the fit of a blurred
// edge.
#pragma once

#include <arhost/frame.h>
#include <arhost/shading/scalar.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <numeric>
#include <optional>
#include <span>
#include <vector>

namespace arhost::fiducial {

// The linear light of each code of the grey plane.
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

// Returns the upper median. Reorders the values.
template <class T> T median(std::vector<T> &values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::ranges::nth_element(values, middle);
    return *middle;
}

// A pixel near an edge. Its position is relative to a line near the edge.
struct EdgePixel {
    double along_px, across_px;
    double light;
    int column; // ascending; the pixels of a column are at almost the same place along the edge
};

// The edge is the line across_px = offset_px + turn * (along_px - pivot_px). The errors of `offset_px` and `turn` are
// independent.
struct BlurredEdge {
    double pivot_px, offset_px, turn;
    double offset_variance, turn_variance;
    double blur_px;     // standard deviation of the Gaussian blur
    double correlation; // correlation of the offsets of neighbouring columns; about 0 if only noise moves them
};

// Fits the edge, its blur and the light of both areas to the pixels by the method of least squares
// (Levenberg–Marquardt): light(across_px) = before + (after - before) * Φ(distance from the edge / blur_px), where Φ
// is the distribution function of the standard normal distribution. The fitted blur includes the averaging of light
// over square pixels. In contrast to a search along profiles, the fit does not interpolate. It therefore has no
// periodic error along edges whose slope is a simple fraction. Excludes up to half of the columns if they do not
// match, for example because an object hides them. If the light of an area clearly changes along the edge, first
// removes the changes of both areas. The variances are computed from the residuals; they include the errors of the
// removed changes and the correlation of neighbouring columns. `blur_px`: the initial value, greater than 0. Returns
// std::nullopt if the fit does not converge near the line.
std::optional<BlurredEdge> fit_blurred_edge(std::span<const EdgePixel> pixels, double blur_px);

} // namespace arhost::fiducial
