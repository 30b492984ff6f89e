// SPDX-License-Identifier: Apache-2.0
//
// Composites the ray-traced overlay B over the video frame A (equation 3.6 of the dissertation).
#pragma once

#include <arhost/frame.h>
#include <arhost/raytracer.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace arhost {

// The overlay, in the format of arhost_image: RGBA8, straight alpha, same size as the frame. `rgba` is nullptr if
// there is no overlay.
struct ImageView {
    const std::uint8_t *rgba = nullptr;
    std::size_t stride = 0; // bytes
};

// The part of the overlay that must be read; alpha is 0 everywhere else.
struct Region {
    std::uint32_t x = 0, y = 0, width = 0, height = 0; // px
};

// The augmented frame: BGR8, same size as the input frame.
struct OutputView {
    std::uint8_t *bgr = nullptr;
    std::size_t stride = 0; // bytes
};

// Returns the region that a ray tracer reported, clipped to the image, or the entire image if it reported none.
constexpr Region region_of(const arhost_render_info &info, std::uint32_t width, std::uint32_t height) {
    if (!info.has_region)
        return {0, 0, width, height};
    const std::uint32_t x = std::min(info.region_x, width), y = std::min(info.region_y, height);
    return {x, y, std::min(info.region_width, width - x), std::min(info.region_height, height - y)};
}

// Enlarges an image of the size `from_width` × `from_height` to that of `format`, bilinearly with premultiplied
// alpha. The edges of both images coincide. Writes only the pixels of the returned region, which covers the enlarged
// `region`. Other pixels keep their values, and callers must treat them as transparent. Clips `region`, which may
// come from an untrusted worker. `rgba` has `stride` bytes per row.
Region enlarge(const ImageView &image, std::uint32_t from_width, std::uint32_t from_height, const Region &region,
               const arhost_frame_format &format, std::uint8_t *rgba, std::size_t stride);

// Let A be the video frame, B the overlay's colour and α its alpha. Writes (A·(255 − α) + B·α) / 255 for each 8-bit
// channel inside the region, and a copy of A outside of it. Results are rounded to nearest; there are no ties because
// 255 is odd. Clips the region, which may come from an untrusted worker. `format` must have passed
// arhost_frame_layout. Accesses only bytes of pixels, not the padding of rows. Pointers and strides need no
// alignment. Uses one thread and allocates no memory.
//
// Formats other than BGR8 are first converted to R'G'B'; subsampled chroma is replicated, not interpolated. With y =
// Y − 16 (limited range) or Y, u = U − 128 and v = V − 128, the matrices of ITU-R BT.601-7 §2.5 and BT.709-6 §3 are
// applied in fixed point:
//   R = clamp8((y' + [v·rv] + 32) >> 6),  G = clamp8((y' − [u·gu] − [v·gv] + 32) >> 6),
//   B = clamp8((y' + [u·bu] + 32) >> 6),  y' = [y·yy],
// where [ ] is a product in units of 1/64, rounded to nearest. The results differ from the exact values by at most 1.
void composite(const arhost_frame_format &format, const std::uint8_t *const planes[ARHOST_MAX_PLANES],
               const ImageView &overlay, const Region &region, const OutputView &out);

} // namespace arhost
