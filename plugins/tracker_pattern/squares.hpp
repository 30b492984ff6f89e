// SPDX-License-Identifier: Apache-2.0
//
// Dark squares on a bright ground.
#pragma once

#include <fiducial/observations.hpp>

#include <opencv2/core.hpp>

#include <vector>

namespace tracker_pattern {

// Returns the corners of the dark quadrilaterals in an image, clockwise from any corner, to within a few px. The same
// square may be found several times. `min_side_px`: of its shortest side.
std::vector<arhost::fiducial::Corners> find_squares(const cv::Mat &grey, double min_side_px);

} // namespace tracker_pattern
