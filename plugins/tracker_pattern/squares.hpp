// SPDX-License-Identifier: Apache-2.0
//
// Finds dark squares on a bright background.
#pragma once

#include <fiducial/observations.hpp>

#include <opencv2/core.hpp>

#include <vector>

namespace tracker_pattern {

// Returns the corners of the dark quadrilaterals in an image, clockwise from any corner, with errors of a few px. The
// result may contain a square several times. `min_side_px`: minimum length of the shortest side.
std::vector<arhost::fiducial::Corners> find_squares(const cv::Mat &grey, double min_side_px);

} // namespace tracker_pattern
