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
