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

// The meaning of the pixels of an overlay, and how they are blended with the video.
struct OverlayFormat {
    arhost_image_form form = ARHOST_IMAGE_FORM_STRAIGHT;
    arhost_compositing compositing = ARHOST_COMPOSITING_SRGB; // of straight images
    bool operator==(const OverlayFormat &) const = default;
    constexpr bool is_linear() const { return form == ARHOST_IMAGE_FORM_LINEAR; }
    constexpr std::size_t pixel_bytes() const { return is_linear() ? 16 : 4; }
};

// The overlay, in the format of arhost_image, with the same size as the frame. `pixels` is nullptr if there is no
// overlay. Those of a linear image are aligned to 2 bytes.
struct ImageView {
    const std::uint8_t *pixels = nullptr;
    std::size_t stride = 0; // bytes
    OverlayFormat format{};
    const std::uint8_t *at(std::size_t x, std::size_t y) const {
        return pixels + y * stride + x * format.pixel_bytes();
    }
};

// The part of the overlay that must be read; everywhere else, virtual objects do not affect the video.
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

// Enlarges an image of the size `from_width` × `from_height` to that of `format`, bilinearly: straight images with
// premultiplied alpha, linear ones both quantities. The edges of both images coincide. Writes only the pixels of the
// returned region, which covers the enlarged `region`. Other pixels keep their values, and callers must treat them as
// transparent. Clips `region`, which may come from an untrusted worker. `pixels` has `stride` bytes per row and the
// image's format.
Region enlarge(const ImageView &image, std::uint32_t from_width, std::uint32_t from_height, const Region &region,
               const arhost_frame_format &format, std::uint8_t *pixels, std::size_t stride);

// Let A be the video frame, B the overlay's colour and α its alpha. Writes (A·(255 − α) + B·α) / 255 for each 8-bit
// channel inside the region, and a copy of A outside of it. Results are rounded to nearest; there are no ties because
// 255 is odd. With ARHOST_COMPOSITING_LINEAR, A and B are the linear light of the sRGB codes, except that the result
// is exactly A where α is 0, and exactly B where α is 255. A linear overlay gives added + transmittance·A in linear
// light, exactly A where it leaves the video unchanged. Any numbers are allowed in it: those below 0 and NaN give
// black, those above 1 white. Clips the region, which may come from an untrusted worker. `format` must have passed
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
