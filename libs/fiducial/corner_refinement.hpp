// SPDX-License-Identifier: Apache-2.0
//
// Estimates of a marker's corners with errors of a fraction of a pixel. README.md compares them.
#pragma once

#include "observations.hpp"
#include "undistortion.hpp"

#include <functional>
#include <optional>

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

struct AlignedPrint : MeasuredCorners {
    double white = 0; // its light, where the illumination is brightest; 255 is the brightest code
};

// Fits a picture of the whole print to the frame: its corners, its blur, the light of black and of white, and how the
// illumination changes across it, by the method of least squares (Levenberg–Marquardt). All cells contribute, so this
// is accurate where blur mixes an edge with the cells beside it. Pixels that do not fit, and those that blur mixes
// with them, are left out: up to a quarter of all. `corners_px` are correct to about half a cell. The errors of the
// coordinates depend on each other, so `sigma_px` is the standard deviation of the independent noise for which the
// 95 % ellipsoid of the pose contains the errors of the pose as often; it follows from the residuals. Returns
// std::nullopt if the picture does not resemble the frame.
std::optional<AlignedPrint> align_print(const cv::Mat &grey, arhost_transfer transfer, const Corners &corners_px,
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
