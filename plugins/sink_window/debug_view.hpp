// SPDX-License-Identifier: Apache-2.0
//
// Shows the measurements of the tracker in the picture.
#pragma once

#include "overlay.hpp"

#include <arhost/shading/lens.hpp>
#include <arhost/sink.h>

namespace sink_window {

// Draws the outlines, the ids and, if the lens is known, the axes of the markers (x red, y green, z blue), and their
// numbers in a box at the top. Returns the height of the box in px.
double draw_debug_view(const Overlay &overlay, const View &view, const arhost_record &record,
                       const arhost::shading::Lens *lens, double focal_length_px);

} // namespace sink_window
