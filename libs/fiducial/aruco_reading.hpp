// SPDX-License-Identifier: Apache-2.0
//
// Reads the bits of a marker that OpenCV has detected.
#pragma once

#include "observations.hpp"
#include "opencv_aruco.hpp"

#include <cstdint>

namespace arhost::aruco {

struct Reading {
    std::uint32_t wrong_bits;
    bool has_whole_border;      // each of its cells is black, or white if the marker is inverted
    double contrast;            // half of the difference between the mean grey levels of white and of black cells
    double false_positive_rate; // as arhost_observation has it
};

// Reads the bits once more, because OpenCV does not tell how many of them it has corrected.
// `is_oriented`: the corners begin at the top left of the drawn marker; otherwise at any of its corners.
Reading read(const cv::Mat &grey, const fiducial::Corners &corners_px, const cv::aruco::Dictionary &dictionary,
             int id, int border_bits, bool is_oriented);

} // namespace arhost::aruco
