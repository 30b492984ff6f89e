// SPDX-License-Identifier: Apache-2.0
//
// Estimates the corners of a marker with errors of a fraction of a pixel. README.md compares the methods.
#pragma once

#include "observations.hpp"
#include "undistortion.hpp"

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>

namespace arhost::fiducial {

// Fits lines to the four edges of the black square (white, if the marker is inverted) near the rough corners, and
// returns the intersections of these lines. In contrast to a search for the corners, this method uses whole edges,
// has no inward bias, and tolerates a hidden corner. Profiles across an edge locate it roughly; then a line is fitted
// to the pixels beside it (ADR 32). The lines are fitted in undistorted pixels, where edges are straight. They are
// fitted in linear light, where a blurred edge is symmetric: in sRGB codes, the middle of its slope lies about 0.2 px
// inside the black (ADR 30).
// - `transfer`: the transfer function of the frame.
// - `cells`: the side of the square in cells. The search for an edge stays within one cell of it, because only the
//   border and the margin, each one cell wide, are uniform.
// - `is_subpixel`: whether the rough corners are accurate to a fraction of a pixel. If they are, the function returns
//   them when noise or blur hides the edges.
// - `blur_cells`: if not null, receives the standard deviation of the blur at the most blurred edge, in cells,
//   also if the function returns std::nullopt; 0 if no edge was found.
// - `max_blur_cells`: if the blur is greater, the function does not search edges again, at more positions, that it
//   has not found well.
// The standard deviation of the corners is computed from the residuals of the fits. Returns std::nullopt if the
// function does not find four edges that fit the image at least as well as the rough edges; the rough corners are
// then the best estimate.
std::optional<MeasuredCorners> refine_edges(const cv::Mat &grey, arhost_transfer transfer, const Corners &rough_px,
                                            const Lens &lens, int cells, bool is_subpixel = false,
                                            double *blur_cells = nullptr,
                                            double max_blur_cells = std::numeric_limits<double>::infinity());

struct AlignedPrint : MeasuredCorners {
    double white = 0; // light of white where the illumination is brightest; 255 is the light of the highest code
};

// Fits a picture of the whole printed marker to the frame by the method of least squares (Levenberg–Marquardt). The
// unknowns are the corners, the blur, the light of black and of white, and the change of the illumination across the
// marker. All cells contribute, so the result is accurate even where blur mixes an edge with adjacent cells. The fit
// excludes pixels that do not match the picture, and pixels that blur mixes with them; at most a quarter of all
// pixels. `corners_px` must be correct to about half a cell. `blur_cells`: the initial standard deviation of the
// blur, in cells; 0: unknown. `work`: see refine_by_print(). The errors of the coordinates are correlated. Therefore
// `sigma_px` is the standard deviation of equivalent independent noise: with it, the 95 % ellipsoid of the pose
// contains the true pose in 95 % of cases. It is computed from the residuals. Returns std::nullopt if the frame does
// not resemble the picture.
std::optional<AlignedPrint> align_print(const cv::Mat &grey, arhost_transfer transfer, const Corners &corners_px,
                                        const Lens &lens, const Print &print, double blur_cells = 0,
                                        std::uint64_t *work = nullptr);

// The corners by the edges of the square, and why they may be wrong.
struct CornersByEdges {
    std::optional<MeasuredCorners> edges; // see refine_edges()
    double blur_cells = 0;                // see refine_edges()
    bool are_unreliable = false;          // edges are not found, or are too blurred
    bool are_overexposed = false;         // white is saturated beside them

    bool need_print() const { return are_unreliable || are_overexposed || edges->is_doubtful; }
};

// Both steps of refine_corners(): the edges, and the whole printed marker if they need it. Adds to `work` about the
// number of pixels that the fit has evaluated, each time that it did so. A unit takes about 0.1 µs.
CornersByEdges refine_by_edges(const cv::Mat &grey, arhost_transfer transfer, const Corners &rough_px,
                               const Lens &lens, int cells, bool is_subpixel = false);
std::optional<MeasuredCorners> refine_by_print(const cv::Mat &grey, arhost_transfer transfer, const Corners &rough_px,
                                               const Lens &lens, int cells, const Print &print,
                                               const CornersByEdges &by_edges, std::uint64_t &work);

// Refines corners by the edges of the square (refine_edges) or by the whole printed marker (align_print). It uses the
// whole marker in each of these cases:
// - The standard deviation of the blur is more than 0.2 cells.
// - More than 5 % of the light of white is clipped.
// - The edges are not found.
// - The edges are doubtful, and the whole marker is clearly more precise.
// If alignment of the marker near the edges fails as well, one of the rough corners may be wrong because the corner
// is hidden; the function then estimates that corner from the others. Returns std::nullopt if neither method
// succeeds. `cells`, `is_subpixel`: see refine_edges(). Calls `print` only if it is needed.
std::optional<MeasuredCorners> refine_corners(const cv::Mat &grey, arhost_transfer transfer, const Corners &rough_px,
                                              const Lens &lens, int cells, const std::function<Print()> &print,
                                              bool is_subpixel = false);

} // namespace arhost::fiducial
