// SPDX-License-Identifier: Apache-2.0
//
// The lines of both formats (docs/trajectories.md), line ends included.
#pragma once

#include <arhost/arhost.h>

#include <string>

namespace arhost::trajectory {

// arhost's: a header, then an object a frame. Numbers are the shortest that read back as the same double.
void append_header(std::string &text, const arhost_intrinsics &intrinsics, arhost_clock clock, double fps);
void append_frame(std::string &text, const arhost_record &record);

// The dissertation's: nine numbers of six digits, each with a space behind it. A frame without a camera is
// an empty line, which its programs skip.
void append_dissertation_frame(std::string &text, const arhost_record &record);

} // namespace arhost::trajectory
