// SPDX-License-Identifier: Apache-2.0
//
// The grey plane used by all trackers (arhost/frame.h).
#pragma once

#include <arhost/frame.h>

#include <cstdint>

namespace arhost {

// Fills the grey plane of a frame (rows of format.grey_stride bytes) if the format has a separate one:
// - RGB8, BGR8: 0.299 R + 0.587 G + 0.114 B (ITU-R BT.601-7 §2.5.1), within 1 of OpenCV's BGR2GRAY;
// - YUYV: Y, expanded to 0 to 255 if the range is limited.
// For GREY8, NV12 and I420, plane 0 itself is the grey plane and nothing is written; see has_limited_luma_plane().
void fill_grey(const arhost_frame_format &format, const std::uint8_t *const planes[ARHOST_MAX_PLANES],
               std::uint8_t *grey);

// Reference implementation for tests: writes the same bytes as fill_grey(), but processes one pixel at a time.
void fill_grey_reference(const arhost_frame_format &format, const std::uint8_t *const planes[ARHOST_MAX_PLANES],
                         std::uint8_t *grey);

// Returns whether plane 0 is the grey plane, but has limited range. Trackers then get a full-range copy, because the
// compositor and the outputs need the original plane.
constexpr bool has_limited_luma_plane(const arhost_frame_format &format) {
    return (format.pixel_format == ARHOST_PIXEL_FORMAT_NV12 || format.pixel_format == ARHOST_PIXEL_FORMAT_I420) &&
           format.yuv_range != ARHOST_YUV_RANGE_FULL;
}

// Expands a limited-range luma plane to `grey`, which has the same stride (format.grey_stride).
void expand_luma_plane(const arhost_frame_format &format, const std::uint8_t *luma, std::uint8_t *grey);

} // namespace arhost
