// SPDX-License-Identifier: Apache-2.0
//
// Shows the measurements of the tracker in the picture.
#pragma once

#include "overlay.hpp"

#include <arhost/shading/lens.hpp>
#include <arhost/sink.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace sink_window {

using Timings = std::vector<std::pair<std::string, std::string>>; // name of a stage or output, percentiles

inline std::string count_of(std::int64_t number, const std::string &noun) {
    return std::to_string(number) + " " + noun + (number == 1 ? "" : "s");
}

// Draws the outlines of the markers and the names, states and, if the lens is known, axes of the targets (x red, y
// green, z blue), and their numbers and the times of the stages in a box at the top. Returns the height of the box in
// px.
double draw_debug_view(const Overlay &overlay, const View &view, const arhost_record &record,
                       const arhost::shading::Lens *lens, double focal_length_px, const Timings &timings);

} // namespace sink_window
