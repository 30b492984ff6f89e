// SPDX-License-Identifier: Apache-2.0
//
// Pattern files of ARToolKit (.patt): the picture inside the black border of a square.
#pragma once

#include <opencv2/core.hpp>

#include <string>

namespace arhost::fiducial {

// Returns the luma of the upright picture, as many rows as columns. The file has the picture in four orientations,
// each with the planes blue, green and red, as rows of numbers from 0 to 255. Throws
// Failure(ARHOST_STATUS_ERROR_CONFIGURATION), with the place of the error.
cv::Mat_<float> read_pattern(const std::string &file);

} // namespace arhost::fiducial
