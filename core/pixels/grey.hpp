// SPDX-License-Identifier: Apache-2.0
//
// The grey plane that all trackers share (arhost/frame.h).
#pragma once

#include <arhost/frame.h>

#include <cstdint>

namespace arhost {

// Fills the grey plane of a frame, rows of format.grey_stride bytes, where it is a plane of its own:
// - RGB8, BGR8: 0.299 R + 0.587 G + 0.114 B (ITU-R BT.601-7 §2.5.1), within 1 of OpenCV's BGR2GRAY;
// - YUYV: Y, expanded from limited range to 0 to 255 where the format says so.
// For GREY8, NV12 and I420 the grey plane is plane 0 as it stands, whatever its range: trackers want
// contrast, and a copy would cost more than it gives. Nothing is written then.
void fill_grey(const arhost_frame_format &format, const std::uint8_t *const planes[ARHOST_MAX_PLANES],
               std::uint8_t *grey);

// The same bytes, a pixel at a time: the definition that tests hold `fill_grey` against.
void fill_grey_reference(const arhost_frame_format &format, const std::uint8_t *const planes[ARHOST_MAX_PLANES],
                         std::uint8_t *grey);

} // namespace arhost
