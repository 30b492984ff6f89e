// SPDX-License-Identifier: Apache-2.0
//
// Functions that append lines in both formats (docs/trajectories.md), including line ends.
#pragma once

#include <arhost/arhost.h>

#include <string>

namespace arhost::trajectory {

// Format `arhost`: a header line, then one JSON object per frame. Numbers read back as the same double.
void append_header(std::string &text, const arhost_intrinsics &intrinsics, arhost_clock clock, double fps);
void append_frame(std::string &text, const arhost_record &record);

// Format `dissertation` (docs/trajectories.md): the nine numbers of eye, look-at point and up vector per line, with
// six significant digits, each followed by a space. A frame without a camera gets an empty line.
void append_dissertation_frame(std::string &text, const arhost_record &record);

} // namespace arhost::trajectory
