// SPDX-License-Identifier: Apache-2.0
//
// Subpixel refinement of a marker's corners.
#pragma once

#include "planar_pose.hpp"

namespace arhost::fiducial {

// Fits lines to the four edges of the black (or inverted: white) square near the rough corners, and returns their
// intersections. Unlike a search at the corner itself, this uses the whole edge, has no inward bias, and tolerates a
// hidden corner. Lines are fitted in undistorted pixels, where edges are straight. std::nullopt if the image does not
// have four such edges.
std::optional<Corners> refine_edges(const cv::Mat &grey, const Corners &rough_px, const Lens &lens);

} // namespace arhost::fiducial
