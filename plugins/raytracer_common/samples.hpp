// SPDX-License-Identifier: Apache-2.0
//
// Sample positions in a pixel: the same for every pixel and in all of arhost's ray tracers.
#pragma once

#include <cstdint>
#include <vector>

namespace arhost::raytracer_common {

// Offsets from the pixel's centre, in px: −½ to ½.
struct Sample {
    float x, y;
};

// N-rooks sampling: one sample in each of `count` rows and columns of the pixel, with the columns in the order of the
// base-2 radical inverse. A single sample is at the centre.
std::vector<Sample> sample_positions(std::uint32_t count);

// `count` samples of an infinite low-discrepancy sequence, from index `first`; index 0 is at the centre (R2: M.
// Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018).
std::vector<Sample> sample_positions(std::uint32_t first, std::uint32_t count);

} // namespace arhost::raytracer_common
