// SPDX-License-Identifier: Apache-2.0
//
// B over A: the ray-traced overlay laid over the video frame, equation 3.6 of the dissertation.
#pragma once

#include <arhost/frame.h>
#include <arhost/raytracer.h>

#include <cstddef>
#include <cstdint>

namespace arhost {

// The overlay B as in arhost_image: RGBA8, straight alpha, the frame's width and height. No bytes: none.
struct ImageView {
    const std::uint8_t *rgba = nullptr;
    std::size_t stride = 0; // bytes
};

// The part of the image outside of which the overlay is not read: every alpha is 0 there.
struct Region {
    std::uint32_t x = 0, y = 0, width = 0, height = 0; // px
};

// Where the augmented frame goes: BGR8, the frame's width and height.
struct OutputView {
    std::uint8_t *bgr = nullptr;
    std::size_t stride = 0; // bytes
};

// The region that a ray tracer reported, or the whole image where it reported none.
constexpr Region region_of(const arhost_render_info &info, std::uint32_t width, std::uint32_t height) {
    if (!info.has_region)
        return {0, 0, width, height};
    return {info.region_x, info.region_y, info.region_width, info.region_height};
}

// Writes out = (A·(255 − α) + B·α) / 255 for each 8-bit channel, rounded to nearest (a tie can't occur:
// 255 is odd), and a plain copy of A outside the region. The region is clipped to the image, so it may
// come from an untrusted worker; `format` must have passed arhost_frame_layout. No byte outside the
// rows' pixels is read or written; pointers and strides need no alignment. One thread, no allocation.
//
// A in another format than BGR8 becomes R'G'B' first. Chroma is replicated. With y = Y − 16 (limited
// range) or Y, u = U − 128 and v = V − 128, the matrices of ITU-R BT.601-7 §2.5 and BT.709-6 §3 are
// applied in fixed point:
//   R = clamp8((y' + [v·rv] + 32) >> 6),  G = clamp8((y' − [u·gu] − [v·gv] + 32) >> 6),
//   B = clamp8((y' + [u·bu] + 32) >> 6),  y' = [y·yy],
// where [ ] is the product in 1/64, rounded to nearest. That is within 1 of the exact value.
void composite(const arhost_frame_format &format, const std::uint8_t *const planes[ARHOST_MAX_PLANES],
               const ImageView &overlay, const Region &region, const OutputView &out);

// The same bytes, a pixel at a time: the definition that tests hold `composite` against.
void composite_reference(const arhost_frame_format &format, const std::uint8_t *const planes[ARHOST_MAX_PLANES],
                         const ImageView &overlay, const Region &region, const OutputView &out);

} // namespace arhost
