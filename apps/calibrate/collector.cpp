// SPDX-License-Identifier: Apache-2.0
#include "calibrate/collector.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace arhost::calibrate {
namespace {

// Returns the mean distance in px between the positions of the corners that both views contain; infinity if there are
// none.
double motion_px(const View &from, const View &to) {
    double sum = 0;
    std::size_t count = 0;
    for (std::size_t i = 0; i < to.board_mm.size(); ++i) {
        const auto same = std::ranges::find(from.board_mm, to.board_mm[i]);
        if (same == from.board_mm.end())
            continue;
        sum += cv::norm(to.image_px[i] - from.image_px[static_cast<std::size_t>(same - from.board_mm.begin())]);
        ++count;
    }
    return count == 0 ? INFINITY : sum / static_cast<double>(count);
}

constexpr double always_sharp_px = 4; // edge width; blur of 1.4 px

} // namespace

Collector::Collector(const cv::Size &image, Model model, std::size_t limit)
    : image_(image), model_(model), limit_(limit), lens_(assumed_lens(image)), coverage_(image),
      sharpest_px_(INFINITY) {}

Collector::Verdict Collector::offer(const std::optional<View> &view, double edge_width_px) {
    const auto verdict = [&] {
        if (!view)
            return Verdict::no_board;
        sharpest_px_ = std::min(sharpest_px_, edge_width_px);
        const double still_px = std::hypot(image_.width, image_.height) / 1000;
        if (!previous_ || motion_px(*previous_, *view) > still_px)
            return Verdict::moving;
        if (edge_width_px > std::max(always_sharp_px, 1.5 * sharpest_px_))
            return Verdict::blurred;
        constexpr double new_placement = 0.15; // of the image's side; 9 degrees
        if (is_full() || (novelty(placement_of(*view, tilt_of(*view, lens_), image_), placements_) < new_placement &&
                          coverage_.new_cells(*view) < 2))
            return Verdict::similar;
        take(*view);
        return Verdict::taken;
    }();
    previous_ = view;
    repeated_ = verdict == last_ ? repeated_ + 1 : 1;
    return last_ = verdict;
}

void Collector::take(const View &view) {
    views_.push_back(view);
    // The tilts depend on the focal length, so they are recomputed with the best known focal length.
    if (views_.size() >= next_calibration_) {
        next_calibration_ = views_.size() * 5 / 4 + 1;
        try {
            lens_ = calibrate(views_, image_, model_).lens;
        } catch (const std::runtime_error &) { // the tilts of the views differ too little; more views will follow
        }
    }
    coverage_ = Coverage(image_);
    placements_.clear();
    for (const View &taken : views_) {
        const Tilt tilt = tilt_of(taken, lens_);
        placements_.push_back(placement_of(taken, tilt, image_));
        coverage_.add(taken, tilt);
    }
}

std::string Collector::advice() const {
    constexpr int some_frames = 15;
    if (views_.empty() && last_ == Verdict::no_board)
        return "show the board to the camera";
    if (repeated_ >= some_frames && last_ == Verdict::no_board)
        return "the board is not visible; show it to the camera";
    if (repeated_ >= some_frames && last_ == Verdict::moving)
        return "hold the board still";
    if (repeated_ >= some_frames && last_ == Verdict::blurred)
        return "the board is blurred; focus the camera, or use more light";
    const std::vector<std::string> missing = coverage_.missing();
    return missing.empty() ? "the views are complete" : missing.front();
}

} // namespace arhost::calibrate
