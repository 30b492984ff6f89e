// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>

namespace arhost::fiducial {

// The cells of a print from the top left: 1 is white, 0 is black. `margin` cells around the square are known.
struct Print {
    cv::Mat_<float> cells;
    int margin = 0;

    int side() const { return cells.rows - 2 * margin; } // of the square
};

} // namespace arhost::fiducial
