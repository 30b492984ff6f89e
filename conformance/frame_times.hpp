// SPDX-License-Identifier: Apache-2.0
//
// How long a plugin takes for a frame, for the tests of speed.
#pragma once

#include "conformance/test.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

namespace arhost::conformance {

// Sorted, in ms, of 100 calls of `frame`, or of as many as take 1 s, but of 11 at least; and until it returns false.
template <class Frame> std::vector<double> frame_times_ms(Frame &&frame) {
    using Clock = std::chrono::steady_clock;
    constexpr std::size_t least = 11, most = 100;
    constexpr auto enough = 1s;
    std::vector<double> ms;
    const auto first = Clock::now();
    while (ms.size() < most && (ms.size() < least || Clock::now() - first < enough)) {
        const auto begin = Clock::now();
        if (!frame())
            break;
        ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - begin).count());
    }
    std::sort(ms.begin(), ms.end());
    return ms;
}

// By the nearest rank.
inline double percentile(const std::vector<double> &sorted, double percent) {
    const double rank = std::ceil(percent / 100 * static_cast<double>(sorted.size()));
    return sorted.at(static_cast<std::size_t>(std::max(rank, 1.0)) - 1);
}

// Notes p50 and p99 in the report, and warns where p50 is above `bound_ms`.
inline void judge_speed(Context &context, std::uint32_t width, std::uint32_t height,
                        const std::vector<double> &sorted_ms, double bound_ms) {
    const double p50 = percentile(sorted_ms, 50);
    context.note = fmt::format("{}×{}: p50 {:.3g} ms, p99 {:.3g} ms, of {} frames", width, height, p50,
                               percentile(sorted_ms, 99), sorted_ms.size());
    if (p50 > bound_ms)
        throw Warning(fmt::format("{}; more than {} ms", context.note, bound_ms));
}

} // namespace arhost::conformance
