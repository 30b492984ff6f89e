// SPDX-License-Identifier: Apache-2.0
#include "host/quality.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace arhost::host {
namespace {

constexpr double scale_step = 0.84; // the resulting image has 0.7 times the pixels
// Cost of an image of which a quarter of the pixels is shaded, relative to one that is shaded everywhere. Measured
// with rt_embree: 0.58 to 0.62 where objects fill the picture, 0.86 where they cover a sixth of it.
constexpr double cost_of_quarter_shading = 0.65;
constexpr std::size_t min_images = 3;
constexpr std::chrono::milliseconds window_length{500};
constexpr std::chrono::seconds time_to_follow{1};
constexpr int fast_windows_to_raise = 4, windows_to_confirm = 10;

// In units of the time per frame.
constexpr double too_slow = 0.95; // above this median, the quality is lowered
constexpr double intended = 0.8;  // maximum predicted time of the level that is then chosen
constexpr double fast = 0.75;     // maximum predicted time of a better level to which the quality is raised

// A level that was too slow is tried again when the median time at the next lower level has decreased to this share
// of its earlier value.
constexpr double relief = 0.9;

std::vector<Quality> levels_of(const QualityController::Limits &limits) {
    std::vector<Quality> levels = {{1, limits.max_samples}};
    const auto add = [&](auto change) { change(levels.emplace_back(levels.back())); };
    while (levels.back().samples > std::max(limits.min_samples, 1u))
        add([&](Quality &level) { level.samples = std::max(level.samples / 2, limits.min_samples); });
    if (limits.max_shading_px >= 2)
        add([](Quality &level) { level.shading_px = 2; });
    while (levels.back().scale > limits.min_scale)
        add([&](Quality &level) { level.scale = std::max(level.scale * scale_step, limits.min_scale); });
    return levels;
}

double cost(const Quality &quality) {
    return quality.scale * quality.scale * std::max(quality.samples, 1u) *
           (quality.shading_px > 1 ? cost_of_quarter_shading : 1);
}

} // namespace

bool AdaptableReports::add(const Adaptable &report, Clock::time_point now) {
    if (latest_ == report) {
        other_.reset();
        return false;
    }
    if (std::exchange(other_, report) != report)
        other_begin_ = now;
    if (latest_ && now - other_begin_ < time_to_follow)
        return false;
    latest_ = std::exchange(other_, std::nullopt);
    return true;
}

QualityController::QualityController(const Limits &limits) : limits_(limits), levels_(levels_of(limits)) {}

double QualityController::relative_cost(std::size_t level) const {
    return cost(levels_[level]) / cost(current());
}

void QualityController::change(std::size_t level) {
    level_ = level;
    ++changes_;
    fast_windows_ = 0;
}

void QualityController::lower(double median) {
    if (median_before_raise_ > 0) { // the last raise made the images too slow
        failed_level_ = level_;
        failed_from_median_ = median_before_raise_;
    }
    median_before_raise_ = 0;
    std::size_t level = level_ + 1;
    while (level + 1 < levels_.size() && median * relative_cost(level) > intended)
        ++level;
    change(level);
}

bool QualityController::add(const Quality &quality, std::chrono::nanoseconds render_time, Clock::time_point now) {
    if (quality != current())
        return false;
    if (window_.empty())
        window_begin_ = now;
    window_.push_back(std::chrono::duration<double>(render_time).count() * limits_.target_fps);
    if (window_.size() < min_images || now - window_begin_ < window_length)
        return false;
    std::vector<double> times = std::exchange(window_, {});
    const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
    std::nth_element(times.begin(), middle, times.end());
    const double median = *middle;

    if (median_before_raise_ > 0 && ++windows_since_raise_ == windows_to_confirm)
        median_before_raise_ = 0;
    if (median > too_slow && !is_lowest()) {
        lower(median);
        return true;
    }
    const bool may_raise =
        level_ > 0 && median * relative_cost(level_ - 1) <= fast &&
        (failed_from_median_ == 0 || level_ - 1 != failed_level_ || median <= relief * failed_from_median_);
    fast_windows_ = may_raise ? fast_windows_ + 1 : 0;
    if (fast_windows_ < fast_windows_to_raise)
        return false;
    median_before_raise_ = median;
    windows_since_raise_ = 0;
    if (level_ - 1 == failed_level_)
        failed_from_median_ = 0;
    change(level_ - 1);
    return true;
}

} // namespace arhost::host
