// SPDX-License-Identifier: Apache-2.0
//
// Composites the ray-traced overlay B over the video frame A (equation 3.6 of the dissertation).
#pragma once

#include <arhost/frame.h>
#include <arhost/raytracer.h>

#include <cstddef>
#include <cstdint>

namespace arhost {

// The overlay as in arhost_image: RGBA8, straight alpha, same size as the frame. rgba == nullptr: no overlay.
struct ImageView {
    const std::uint8_t *rgba = nullptr;
    std::size_t stride = 0; // bytes
};

// The part of the overlay to read; all alphas outside are 0.
struct Region {
    std::uint32_t x = 0, y = 0, width = 0, height = 0; // px
};

// The augmented frame: BGR8, same size as the input frame.
struct OutputView {
    std::uint8_t *bgr = nullptr;
    std::size_t stride = 0; // bytes
};

// The region that a ray tracer reported, or the whole image if it reported none.
constexpr Region region_of(const arhost_render_info &info, std::uint32_t width, std::uint32_t height) {
    if (!info.has_region)
        return {0, 0, width, height};
    return {info.region_x, info.region_y, info.region_width, info.region_height};
}

// Writes out = (A·(255 − α) + B·α) / 255 for each 8-bit channel, rounded to nearest (no ties, as 255 is odd), and a
// copy of A outside the region. The region is clipped to the image, so it may come from an untrusted worker; `format`
// must have passed arhost_frame_layout. No bytes outside the rows' pixels are accessed; pointers and strides need no
// alignment. Single-threaded, no allocation.
//
// Formats other than BGR8 are converted to R'G'B' first, with chroma replicated. With y = Y − 16 (limited range) or
// Y, u = U − 128 and v = V − 128, the matrices of ITU-R BT.601-7 §2.5 and BT.709-6 §3 are applied in fixed point:
//   R = clamp8((y' + [v·rv] + 32) >> 6),  G = clamp8((y' − [u·gu] − [v·gv] + 32) >> 6),
//   B = clamp8((y' + [u·bu] + 32) >> 6),  y' = [y·yy],
// where [ ] is the product in units of 1/64, rounded to nearest. The result is within 1 of the exact value.
void composite(const arhost_frame_format &format, const std::uint8_t *const planes[ARHOST_MAX_PLANES],
               const ImageView &overlay, const Region &region, const OutputView &out);

// Reference implementation for tests: the same bytes, pixel by pixel.
void composite_reference(const arhost_frame_format &format, const std::uint8_t *const planes[ARHOST_MAX_PLANES],
                         const ImageView &overlay, const Region &region, const OutputView &out);

} // namespace arhost
