// SPDX-License-Identifier: Apache-2.0
//
// The desk by the window: wood, the marker's sheet, and what else lies about. All procedural.
#pragma once

#include "pyramid.hpp"
#include "surface.hpp"

#include <opencv2/core.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace arhost::synthetic {

struct MarkerSheet {
    cv::Mat_<uint8_t> cells; // of marker_cells()
    std::string family;
    int id;
    double side_mm; // for the caption: the desk is drawn for 80 mm, whatever the size
};

// The side of the black square in the units that the desk is drawn in.
inline constexpr float drawn_side = 80;

// The light that comes back, and in the fourth channel the gloss.
PaintRow paint_desk(const MarkerSheet &sheet, std::uint64_t seed);

// A postcard about the origin: in the fourth channel what it and its shadow cover, with which the others are
// multiplied.
PaintRow paint_card(std::uint64_t seed);
inline constexpr Point card_half{78, 56};

// The light that the camera sees mirrored at a point of a varnished board, against white in full light.
// `view`: the direction of sight, of length 1.
float mirrored_light(Point at, Vec3 view);

} // namespace arhost::synthetic
