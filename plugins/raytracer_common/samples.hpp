// SPDX-License-Identifier: Apache-2.0
//
// Number and positions of the samples in a pixel. The positions are the same in every pixel, and in all ray tracers
// of arhost.
#pragma once

#include <arhost/raytracer.h>

#include <algorithm>
#include <cstdint>
#include <string_view>
#include <vector>

namespace arhost::raytracer_common {

// Values of the option `quality`.
inline constexpr const char *qualities[] = {"realtime", "balanced", "reference", nullptr};
constexpr std::uint32_t samples_of(std::string_view quality) {
    return quality == "realtime" ? 1 : quality == "balanced" ? 4 : 64;
}

// Returns the number of samples per pixel for this request.
inline std::uint32_t limited(std::uint32_t full_samples, const arhost_render_request &request) {
    return request.max_samples > 0 ? std::min(full_samples, request.max_samples) : full_samples;
}

// A sample's offset from the pixel's centre, in px, from −½ to ½.
struct Sample {
    float x, y;
};

// Returns `count` samples by N-rooks sampling: divides the pixel into `count` rows and columns, each of which
// contains one sample. The base-2 radical inverse determines the order of the columns. A single sample is at the
// centre.
std::vector<Sample> sample_positions(std::uint32_t count);

// Returns `count` samples of an infinite low-discrepancy sequence, starting at index `first`. The sample with index 0
// is at the centre (R2 sequence: M. Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018).
std::vector<Sample> sample_positions(std::uint32_t first, std::uint32_t count);

// Accumulation stops at this number of samples. The remaining noise and the rounding errors of the float sums are
// then below half an 8-bit code, so more samples would not change the image.
inline constexpr std::uint32_t max_accumulated_samples = 1u << 16;

// Returns the width, in units of the distance, of the part of a pixel for which one of its samples filters textures.
float ray_angle(const arhost_intrinsics &intrinsics, std::size_t samples_per_pixel);

} // namespace arhost::raytracer_common
