// SPDX-License-Identifier: Apache-2.0
//
// Chooses views from the frames of a video or camera, and advises which view to show next.
#pragma once

#include "calibrate/coverage.hpp"

namespace arhost::calibrate {

class Collector {
public:
    enum class Verdict { no_board, moving, blurred, similar, taken };

    // Takes at most `limit` views.
    Collector(const cv::Size &image, Model model, std::size_t limit);

    // `view`: the board in the next frame, if it is visible; `edge_width_px`: see edge_width_px(). A view is taken if
    // the board is still and sharp, and if its position or its tilt is new.
    Verdict offer(const std::optional<View> &view, double edge_width_px);

    const std::vector<View> &views() const { return views_; }
    const Coverage &coverage() const { return coverage_; }
    const Lens &lens() const { return lens_; }
    bool is_full() const { return views_.size() >= limit_; }
    bool is_complete() const { return coverage_.missing().empty(); }
    // Returns the next instruction for the person who holds the board.
    std::string advice() const;

private:
    void take(const View &view);

    cv::Size image_;
    Model model_;
    std::size_t limit_;
    Lens lens_;
    Coverage coverage_;
    std::vector<View> views_;
    std::vector<Placement> placements_;
    std::optional<View> previous_;
    double sharpest_px_;               // edge width
    std::size_t next_calibration_ = 6; // number of views
    Verdict last_ = Verdict::no_board;
    int repeated_ = 0; // frames with the verdict `last_`
};

} // namespace arhost::calibrate
