// SPDX-License-Identifier: Apache-2.0
// Measures a plugin's per-frame call, for the speed tests.
#pragma once

#include "conformance/test.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

namespace arhost::conformance {

// Returns the sorted durations (ms) of up to 100 calls. Stops after 1 s, but not before 11 calls, or if `frame`
// returns false.
template <class Frame> std::vector<double> frame_times_ms(Frame &&frame) {
    using Clock = std::chrono::steady_clock;
    constexpr std::size_t min_count = 11, max_count = 100;
    constexpr auto time_limit = 1s;
    std::vector<double> ms;
    const auto first = Clock::now();
    while (ms.size() < max_count && (ms.size() < min_count || Clock::now() - first < time_limit)) {
        const auto begin = Clock::now();
        if (!frame())
            break;
        ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - begin).count());
    }
    std::sort(ms.begin(), ms.end());
    return ms;
}

// Nearest-rank method.
inline double percentile(const std::vector<double> &sorted, double percent) {
    const double rank = std::ceil(percent / 100 * static_cast<double>(sorted.size()));
    return sorted.at(static_cast<std::size_t>(std::max(rank, 1.0)) - 1);
}

// Reports p50 and p99; warns if p50 exceeds `bound_ms`.
inline void check_speed(Context &context, std::uint32_t width, std::uint32_t height,
                        const std::vector<double> &sorted_ms, double bound_ms) {
    const double p50 = percentile(sorted_ms, 50);
    context.note = fmt::format("{}×{}: p50 {:.3g} ms, p99 {:.3g} ms, of {} frames", width, height, p50,
                               percentile(sorted_ms, 99), sorted_ms.size());
    if (p50 > bound_ms)
        throw Warning(fmt::format("{}; the limit of p50 is {} ms", context.note, bound_ms));
}

} // namespace arhost::conformance
