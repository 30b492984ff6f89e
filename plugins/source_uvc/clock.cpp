// SPDX-License-Identifier: Apache-2.0
#include "clock.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

namespace arhost::uvc {
namespace {

constexpr std::size_t max_samples = 256, min_samples = 8;
constexpr std::int64_t second_ns = 1'000'000'000;
// For a shorter time, the variation of the delays hides the error of the rate.
constexpr std::int64_t min_span_ns = 2 * second_ns;
constexpr double max_rate_error = 5e-4;         // maximum error of a quartz clock, with a margin
constexpr double implausible_rate_error = 0.02; // a larger error means that the stated frequency is wrong

} // namespace

std::int64_t DeviceClock::device_ns(std::int64_t ticks) const {
    const auto frequency = static_cast<std::int64_t>(frequency_hz_);
    return ticks / frequency * second_ns + ticks % frequency * second_ns / frequency;
}

void DeviceClock::add(std::uint32_t ticks, std::int64_t arrival_ns) {
    if (frequency_hz_ == 0)
        return;
    // The difference modulo 2^32 is unambiguous for 21 s at 100 MHz.
    const auto step = static_cast<std::int32_t>(ticks - last_ticks_);
    if (!samples_.empty()) {
        const std::int64_t elapsed_ns = arrival_ns - samples_.back().arrival_ns;
        if (elapsed_ns >= 0 && step == 0)
            return;                                                                 // the sample was repeated
        if (elapsed_ns < 0 || std::abs(device_ns(step) - elapsed_ns) > second_ns) { // the camera's clock was reset
            samples_.clear();
            is_known_ = false;
        } else if (step < 0) {
            return; // out of order
        }
    }
    total_ticks_ = samples_.empty() ? 0 : total_ticks_ + step;
    last_ticks_ = ticks;
    samples_.push_back({device_ns(total_ticks_), arrival_ns});
    if (samples_.size() > max_samples)
        samples_.pop_front();
    fit();
}

void DeviceClock::fit() {
    is_known_ = false;
    if (samples_.size() < min_samples)
        return;
    origin_ = samples_.front();
    struct Point {
        double x, y;
    };
    std::vector<Point> hull; // the lower hull
    double mean = 0;
    for (const Sample &sample : samples_) {
        const Point point{static_cast<double>(sample.device_ns - origin_.device_ns),
                          static_cast<double>(sample.arrival_ns - origin_.arrival_ns)};
        mean += point.x / static_cast<double>(samples_.size());
        const auto turns_right = [&] {
            const Point &a = hull[hull.size() - 2], &b = hull.back();
            return (b.x - a.x) * (point.y - a.y) <= (b.y - a.y) * (point.x - a.x);
        };
        while (hull.size() >= 2 && turns_right())
            hull.pop_back();
        hull.push_back(point);
    }
    rate_ = 1;
    if (hull.back().x >= static_cast<double>(min_span_ns)) {
        std::size_t right = 1;
        while (right + 1 < hull.size() && hull[right].x < mean)
            ++right;
        const Point &a = hull[right - 1], &b = hull[right];
        rate_ = (b.y - a.y) / (b.x - a.x);
        if (!(std::abs(rate_ - 1) <= implausible_rate_error))
            return;
        rate_ = std::clamp(rate_, 1 - max_rate_error, 1 + max_rate_error);
    }
    offset_ns_ = hull.front().y - rate_ * hull.front().x;
    for (const Point &point : hull)
        offset_ns_ = std::min(offset_ns_, point.y - rate_ * point.x);
    is_known_ = true;
}

std::optional<std::int64_t> DeviceClock::host_ns(std::uint32_t ticks) const {
    if (!is_known_)
        return std::nullopt;
    const std::int64_t total = total_ticks_ + static_cast<std::int32_t>(ticks - last_ticks_);
    const auto elapsed_ns = static_cast<double>(device_ns(total) - origin_.device_ns);
    return origin_.arrival_ns + std::llround(offset_ns_ + rate_ * elapsed_ns);
}

std::int64_t CaptureTimes::time_of(std::optional<std::uint32_t> presentation_ticks, std::int64_t arrival_ns) {
    std::int64_t time_ns = arrival_ns;
    if (const auto presented = presentation_ticks ? clock_.host_ns(*presentation_ticks) : std::nullopt;
        presented && *presented <= arrival_ns && *presented >= arrival_ns - second_ns)
        time_ns = *presented;
    return last_ns_ = std::max(last_ns_, time_ns);
}

} // namespace arhost::uvc
