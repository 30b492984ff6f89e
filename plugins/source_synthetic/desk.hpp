// SPDX-License-Identifier: Apache-2.0
//
// The desk by the window, and the postcard that can cover the marker.
#pragma once

#include "geometry.hpp"
#include "pyramid.hpp"

#include <opencv2/core.hpp>

#include <cstdint>
#include <string>

namespace arhost::synthetic {

// The desk's plane is measured in units of 1/80 of the marker's side: mm for the default marker.
inline constexpr float marker_side = 80;

struct MarkerSheet {
    cv::Mat_<uint8_t> cells; // from marker_cells()
    std::string family;
    int id;
    double side_mm; // for the caption
};

// The fourth channel of the desk is the gloss of the varnish, that of the card its coverage of the desk, shadow
// included.
struct DeskTextures {
    Pyramid desk, card;
};
DeskTextures make_desk(const MarkerSheet &sheet);
inline constexpr Point card_half{78, 56};

// Light that a varnished board reflects at `at` in the direction of the camera, relative to white in full light.
// `view`: unit vector from the camera.
float reflected_light(Point at, Vec3 view);

} // namespace arhost::synthetic
