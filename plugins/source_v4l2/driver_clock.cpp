// SPDX-License-Identifier: Apache-2.0
#include "driver_clock.hpp"

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <string>

namespace arhost {
namespace {

std::int64_t clock_ns(clockid_t clock) {
    timespec time{};
    clock_gettime(clock, &time);
    return time.tv_sec * std::int64_t{1'000'000'000} + time.tv_nsec;
}

bool is_recent(std::int64_t age_ns) {
    return std::abs(age_ns) < 10'000'000'000;
}

std::int64_t stamp_ns_of(const Capture &captured) {
    return captured.time.tv_sec * std::int64_t{1'000'000'000} + captured.time.tv_usec * std::int64_t{1'000};
}

} // namespace

std::optional<std::int64_t> DriverClock::age_ns(const Capture &captured) {
    const std::int64_t age_ns = clock_ns(CLOCK_MONOTONIC) - stamp_ns_of(captured);
    if ((captured.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC || !is_recent(age_ns))
        return {};
    return std::max<std::int64_t>(age_ns, 0);
}

std::int64_t DriverClock::monotonic_ns(const Capture &captured) {
    const std::int64_t now_ns = clock_ns(CLOCK_MONOTONIC);
    if (const auto age = age_ns(captured))
        return now_ns - *age;
    // Old drivers use the wall clock or do not state which clock they use.
    const std::int64_t age_ns = clock_ns(CLOCK_REALTIME) - stamp_ns_of(captured);
    if (!reported_)
        host_.warn("the camera driver does not use CLOCK_MONOTONIC; " +
                   std::string(is_recent(age_ns) ? "its wall-clock time stamps are converted"
                                                 : "arrival times are used instead"));
    reported_ = true;
    return is_recent(age_ns) ? now_ns - std::max<std::int64_t>(age_ns, 0) : now_ns;
}

} // namespace arhost
