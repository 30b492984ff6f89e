// SPDX-License-Identifier: Apache-2.0
//
// SIMD kernels that process `count` pixels of a row and produce the same results as formulas.hpp. They use the best
// instruction set that the machine has, do not access bytes outside these pixels, and need no alignment.
#pragma once

#include "pixels/formulas.hpp"

#include <cstddef>
#include <cstdint>

namespace arhost::rows {

// Blends `rgba` over `bgr` and writes the result to `out`, which may be the same buffer as `bgr`.
void blend(const std::uint8_t *bgr, const std::uint8_t *rgba, std::uint8_t *out, std::size_t count);

// Adds the light of an overlay of ARHOST_IMAGE_FORM_LINEAR, eight halves per pixel, to the light of `bgr` that it
// transmits; like added_and_transmitted() of linear.hpp, and exactly `bgr` where the pixel is `untouched`. `out` may
// be `bgr`.
void add_light(const std::uint8_t *bgr, const std::uint16_t *linear, std::uint8_t *out, std::size_t count);

// Two adjacent pixels or rows between which another one is interpolated, and the weight of the second.
struct Between {
    static constexpr std::uint32_t one = 128; // small, so that sums of weighted straight pixels fit in 32 bits
    std::uint32_t first, second, weight;      // weight: in units of 1/one
};

// Interpolates `count` pixels of an image of ARHOST_IMAGE_FORM_LINEAR, each between two columns of the rows `above`
// and `below`; `row_weight` is the weight of `below`. Equal finite pixels are not changed.
void interpolate_light(const std::uint16_t *above, const std::uint16_t *below, std::uint32_t row_weight,
                       const Between *columns, std::uint16_t *out, std::size_t count);

// Convert to BGR. For YUV formats, `count` must be even, and chroma is replicated.
void bgr_from_grey(const std::uint8_t *grey, std::uint8_t *bgr, std::size_t count);
void bgr_from_rgb(const std::uint8_t *rgb, std::uint8_t *bgr, std::size_t count);
void bgr_from_yuyv(const std::uint8_t *yuyv, const YuvMatrix &matrix, std::uint8_t *bgr, std::size_t count);
void bgr_from_nv12(const std::uint8_t *y, const std::uint8_t *uv, const YuvMatrix &matrix, std::uint8_t *bgr,
                   std::size_t count);
void bgr_from_i420(const std::uint8_t *y, const std::uint8_t *u, const std::uint8_t *v, const YuvMatrix &matrix,
                   std::uint8_t *bgr, std::size_t count);

// Convert to full-range grey.
void grey_from_bgr(const std::uint8_t *bgr, std::uint8_t *grey, std::size_t count);
void grey_from_rgb(const std::uint8_t *rgb, std::uint8_t *grey, std::size_t count);
void grey_from_yuyv(const std::uint8_t *yuyv, bool limited, std::uint8_t *grey, std::size_t count);
void grey_from_limited_luma(const std::uint8_t *luma, std::uint8_t *grey, std::size_t count);

} // namespace arhost::rows
