// SPDX-License-Identifier: Apache-2.0
//
// Makes a marker's corners exact to a small part of a pixel.
#pragma once

#include "planar_pose.hpp"

namespace arhost::planar {

// From rough corners to where lines fitted to the four edges of the black (or inverted: white) square cross.
// Unlike a search at the corner itself this uses the whole edge, has no pull to the inside, and bears a
// corner that is hidden. Edges are straight before the lens, so the lines are fitted there. Nothing where
// the picture has no four such edges: then it shows no whole marker.
std::optional<Corners> refine_edges(const cv::Mat &grey, const Corners &rough_px, const Lens &lens);

} // namespace arhost::planar
