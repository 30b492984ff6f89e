// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/samples.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace arhost::raytracer_common {
namespace {

double radical_inverse_2(std::uint32_t i) {
    double inverse = 0;
    for (double digit = 0.5; i; i /= 2, digit /= 2)
        inverse += digit * (i % 2);
    return inverse;
}

} // namespace

std::vector<Sample> sample_positions(std::uint32_t count) {
    std::vector<std::uint32_t> columns(count);
    std::iota(columns.begin(), columns.end(), 0u);
    std::sort(columns.begin(), columns.end(),
              [](std::uint32_t a, std::uint32_t b) { return radical_inverse_2(a) < radical_inverse_2(b); });
    std::vector<Sample> samples;
    samples.reserve(count);
    const auto offset = [size = static_cast<float>(count)](std::uint32_t i) {
        return (static_cast<float>(i) + 0.5f) / size - 0.5f;
    };
    for (std::uint32_t row = 0; row < count; ++row)
        samples.push_back({offset(columns[row]), offset(row)});
    return samples;
}

std::vector<Sample> sample_positions(std::uint32_t first, std::uint32_t count) {
    std::vector<Sample> samples;
    samples.reserve(count);
    for (std::uint32_t i = first; i != first + count; ++i) {
        const auto offset = [i](std::uint32_t step) { // i · step / 2³² modulo 1, in the range −½ to ½
            return static_cast<float>(static_cast<std::int32_t>(i * step)) * 0x1p-32f;
        };
        samples.push_back({offset(3242174889u), offset(2447445414u)});
    }
    return samples;
}

float ray_angle(const arhost_intrinsics &intrinsics, std::size_t samples_per_pixel) {
    constexpr double overlap = 4; // fewer samples miss parts of footprints that are long, at grazing angles
    return static_cast<float>(1 / std::sqrt(intrinsics.fx * intrinsics.fy *
                                            std::max(static_cast<double>(samples_per_pixel) / overlap, 1.0)));
}

} // namespace arhost::raytracer_common
