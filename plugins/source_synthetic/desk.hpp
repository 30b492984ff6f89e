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

// Coordinates on the desk have units of 1/80 of the marker's side. For the default marker, these are mm.
inline constexpr float marker_side = 80;

struct MarkerSheet {
    cv::Mat_<uint8_t> cells; // result of marker_cells()
    std::string family;
    int id;
    double side_mm; // printed in the caption
};

// The fourth channel of the desk is the gloss of the varnish. The fourth channel of the card is its coverage of the
// desk, including its shadow.
struct DeskTextures {
    Pyramid desk, card;
};
DeskTextures make_desk(const MarkerSheet &sheet);
inline constexpr Point card_half{78, 56};

// Returns the light that a varnished board at `at` reflects towards the camera, relative to white in full light.
// `view` is the unit vector from the camera to `at`.
float reflected_light(Point at, Vec3 view);

} // namespace arhost::synthetic
