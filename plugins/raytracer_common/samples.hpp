// SPDX-License-Identifier: Apache-2.0
//
// Where in a pixel rays go through: the same in every pixel, and in every ray tracer of arhost.
#pragma once

#include <cstdint>
#include <vector>

namespace arhost::raytracer_common {

// From the pixel's centre: −½ to ½.
struct Sample {
    float x, y;
};

// One in each of `count` rows and columns of the pixel (N-rooks), the columns in the order of the base-2 radical
// inverse, so that samples spread evenly; a single one lies at the centre.
std::vector<Sample> sample_positions(std::uint32_t count);

// `count` of a sequence without end that is even over the pixel however far it goes, from its number `first`; number
// 0 lies at the centre (R2: M. Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018).
std::vector<Sample> sample_positions(std::uint32_t first, std::uint32_t count);

} // namespace arhost::raytracer_common
