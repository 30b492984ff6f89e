// SPDX-License-Identifier: Apache-2.0
//
// Refines the corners of all markers of a frame within a budget.
#pragma once

#include "corner_refinement.hpp"

#include <span>
#include <vector>

namespace arhost::fiducial {

// A marker with the corners that a detector has found. The other members are parameters of refine_corners().
struct RoughMarker {
    Corners corners_px;
    int cells;
    std::function<Print()> print;
    bool is_subpixel = false;
};

class FrameRefinement {
public:
    // `work_per_px`: the budget relative to the number of pixels of the frame. The unit is that of refine_by_print().
    // `grey` and `lens` must outlive the object.
    FrameRefinement(const cv::Mat &grey, arhost_transfer transfer, const Lens &lens, double work_per_px);

    // Does for each marker what refine_corners() does, but does not fit the prints of the smallest markers if the
    // budget is spent. Edges are always fitted; they count, too. The budget is a count of work, so the result depends
    // only on the frame and on the order of the calls. Uses up to `threads` threads (0: as many as OpenCV has).
    std::vector<std::optional<MeasuredCorners>> refine(std::span<const RoughMarker> markers, int threads = 0);

    // Reserves a part of the budget, in the same unit, for other work on the frame. Further calls reserve no more.
    void reserve(double work_per_px) { reserved_ = work_per_px * static_cast<double>(grey_.total()); }

private:
    const cv::Mat &grey_;
    arhost_transfer transfer_;
    const Lens &lens_;
    double work_left_, reserved_ = 0;
};

} // namespace arhost::fiducial
