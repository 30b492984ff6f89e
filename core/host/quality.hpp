// SPDX-License-Identifier: Apache-2.0
//
// Adapts the quality of images to the time that the ray tracer has for each (`live.target_fps`).
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace arhost::host {

// The quality of one image.
struct Quality {
    double scale = 1;             // size of the image relative to the frame
    std::uint32_t samples = 0;    // maximum number per pixel; 0: no limit
    std::uint32_t shading_px = 1; // as in arhost_render_request, but never 0
    bool operator==(const Quality &) const = default;
};

// Fields of arhost_render_info.
struct Adaptable {
    std::uint32_t full_samples = 0, coarsest_shading_px = 0;
    bool operator==(const Adaptable &) const = default;
};

// Follows what the images of a ray tracer report as adaptable. They may report something else only after a change of
// an option; a faulty ray tracer whose reports alternate must not restart the controller with each image.
class AdaptableReports {
public:
    using Clock = std::chrono::steady_clock;

    // Records the report of an image that finished at `now`. Returns whether `latest` has changed: to the first
    // report, or to one that all images of a second have repeated.
    bool add(const Adaptable &report, Clock::time_point now);
    const std::optional<Adaptable> &latest() const { return latest_; } // empty before the first report

private:
    std::optional<Adaptable> latest_, other_; // other_: what the last images report instead, since `other_begin_`
    Clock::time_point other_begin_{};
};

// Chooses among levels of quality: first fewer samples, then fewer pixels that are shaded, then smaller images. To
// prevent oscillation,
// - a level is left only if the median time of half a second exceeds the time per frame; a better level is entered
//   only if its predicted time stays well below the time per frame for two seconds;
// - a better level that turned out to be too slow is entered again only when the time at the next lower level has
//   decreased.
class QualityController {
public:
    using Clock = std::chrono::steady_clock;

    struct Limits {
        double target_fps = 0;
        double min_scale = 1;                           // 1: the scale is not adapted
        std::uint32_t min_samples = 0, max_samples = 0; // 0: samples are not adapted
        std::uint32_t max_shading_px = 1;               // 1: all pixels are shaded
        bool operator==(const Limits &) const = default;
    };

    explicit QualityController(const Limits &limits);

    const Limits &limits() const { return limits_; }
    const Quality &current() const { return levels_[level_]; }
    bool is_lowest() const { return level_ + 1 == levels_.size(); }
    std::uint64_t changes() const { return changes_; }

    // Records the render time of an image that finished at `now`. Returns whether the quality has changed.
    bool add(const Quality &quality, std::chrono::nanoseconds render_time, Clock::time_point now);

private:
    double relative_cost(std::size_t level) const; // cost of an image, relative to the current level
    void change(std::size_t level);
    void lower(double median);

    Limits limits_;
    std::vector<Quality> levels_; // best first
    std::size_t level_ = 0;
    std::uint64_t changes_ = 0;
    std::vector<double> window_; // render times at the current level, in units of the time per frame
    Clock::time_point window_begin_{};
    int fast_windows_ = 0;        // consecutive windows in which a better level seemed possible
    int windows_since_raise_ = 0; // meaningful while median_before_raise_ is not 0
    double median_before_raise_ = 0;
    std::size_t failed_level_ = 0;  // a level that turned out to be too slow
    double failed_from_median_ = 0; // the median at the level below it; 0: no level has failed
};

} // namespace arhost::host
