// SPDX-License-Identifier: Apache-2.0
//
// Draws the coverage of the image by the corners of all views.
#pragma once

#include "calibrate/coverage.hpp"

namespace arhost::calibrate {

// Returns a BGR picture of the image's shape with a legend below. Cells without corners are shaded. Each corner has
// the colour of its residual; corners of dropped views are crosses.
cv::Mat coverage_picture(std::span<const View> views, const Calibration &calibration, const Coverage &coverage);

} // namespace arhost::calibrate
