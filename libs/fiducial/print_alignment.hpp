// SPDX-License-Identifier: Apache-2.0
//
// Corners of markers whose cells are so narrow or blurred that their edges cannot be located one by one.
#pragma once

#include "lens.hpp"
#include "observations.hpp"
#include "print.hpp"

#include <functional>

namespace arhost::fiducial {

// Fits a picture of the whole print to the frame: its corners, its blur, the light of black and of white, and how the
// illumination changes across it, by the method of least squares (Levenberg–Marquardt). All cells contribute, so this
// is accurate where blur mixes an edge with the cells beside it. Pixels that do not fit, and those that blur mixes
// with them, are left out: up to a quarter of all. `corners_px` are correct to about half a cell. The errors of the
// coordinates depend on each other, so `sigma_px` is the standard deviation of the independent noise for which the
// 95 % ellipsoid of the pose contains the errors of the pose as often; it follows from the residuals. Returns
// std::nullopt if the picture does not resemble the frame.
std::optional<MeasuredCorners> align_print(const cv::Mat &grey, arhost_transfer transfer, const Corners &corners_px,
                                           const Lens &lens, const Print &print);

// Refines corners by the edges of the square (refine_edges) or by the whole print: where the standard deviation of
// the blur is more than 0.2 of a cell, more than 5 % of the light of white is clipped, the edges are not found, or
// they are doubtful and the print is clearly more precise. If the print is not found near the edges either, one of
// the rough corners may be wrong: that of a hidden corner. Returns std::nullopt if neither succeeds. `cells` and
// `is_subpixel`: as refine_edges() has them. Calls `print` only if it is needed.
std::optional<MeasuredCorners> refine_corners(const cv::Mat &grey, arhost_transfer transfer, const Corners &rough_px,
                                              const Lens &lens, int cells, const std::function<Print()> &print,
                                              bool is_subpixel = false);

} // namespace arhost::fiducial
