// SPDX-License-Identifier: Apache-2.0
//
// Subpixel refinement of a marker's corners.
#pragma once

#include "lens.hpp"
#include "observations.hpp"

namespace arhost::fiducial {

// Fits lines to the four edges of the black square (white, if the marker is inverted) near the rough corners, and
// returns the intersections of these lines. Unlike a search for the corner itself, this method uses the whole edge,
// has no inward bias, and tolerates a hidden corner. Profiles across the edges find them roughly; then each is fitted
// to the pixels beside it (ADR 32). It fits the lines in undistorted pixels, where edges are straight, and in linear
// light, because a blurred edge is symmetric there: in sRGB codes, the middle of its slope lies about 0.2 px inside
// the black (ADR 30). `transfer` is that of the frame. `cells` is the side of the square in cells; the search for an
// edge stays within one cell of it, because only the border and the margin, one cell wide each, are uniform. The
// noise of the corners follows from the residuals of the fits. Returns std::nullopt if it does not find four edges
// that fit the image at least as well as the rough ones; these are then the best that is known. `is_subpixel`: the
// rough corners are accurate to a fraction of a pixel, so they are kept if noise or blur hides the edges.
std::optional<MeasuredCorners> refine_edges(const cv::Mat &grey, arhost_transfer transfer, const Corners &rough_px,
                                            const Lens &lens, int cells, bool is_subpixel = false);

} // namespace arhost::fiducial
