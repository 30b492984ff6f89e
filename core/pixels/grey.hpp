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
// For GREY8, NV12 and I420, plane 0 itself is the grey plane and nothing is written. Limited range is not expanded
// for these formats: trackers need only contrast, so the expansion is not worth a copy.
void fill_grey(const arhost_frame_format &format, const std::uint8_t *const planes[ARHOST_MAX_PLANES],
               std::uint8_t *grey);

// Reference implementation for tests: writes the same bytes as fill_grey(), but processes one pixel at a time.
void fill_grey_reference(const arhost_frame_format &format, const std::uint8_t *const planes[ARHOST_MAX_PLANES],
                         std::uint8_t *grey);

} // namespace arhost
