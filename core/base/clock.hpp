// SPDX-License-Identifier: Apache-2.0
//
// The clock for deadlines and for decisions about frames. Tests replace it to control the time.
#pragma once

#include <chrono>
#include <cstdint>

namespace arhost::base {

class Clock {
public:
    using duration = std::chrono::steady_clock::duration;
    using time_point = std::chrono::steady_clock::time_point;

    virtual ~Clock() = default;
    virtual time_point now() const = 0; // CLOCK_MONOTONIC
};

class SteadyClock final : public Clock {
public:
    time_point now() const override { return std::chrono::steady_clock::now(); }
};

// Returns the time in ns of CLOCK_MONOTONIC, the unit of the ABI.
inline std::int64_t to_ns(Clock::time_point time) {
    return std::chrono::nanoseconds(time.time_since_epoch()).count();
}

inline const Clock &steady_clock() {
    static const SteadyClock clock;
    return clock;
}

} // namespace arhost::base
