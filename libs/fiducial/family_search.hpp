// SPDX-License-Identifier: Apache-2.0
//
// Finds markers of all families that the AprilTag library and OpenCV know.
#pragma once

#include "observations.hpp"
#include "other_markers.hpp"

#include <opencv2/core.hpp>

#include <span>

namespace arhost::fiducial {

// Returns the markers in a picture that are not of the families `used`, if all of their bits are right and clear. Of
// dictionaries that contain the same markers, names the smallest one that has all that were found. Reduces pictures
// of more than 1280 px, so it misses small markers there.
OtherMarkers::Markers markers_of_other_families(const cv::Mat &grey, std::span<const Family> used);

} // namespace arhost::fiducial
