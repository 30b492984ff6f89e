// SPDX-License-Identifier: Apache-2.0
//
// Deadlines and restart limits of a supervised worker. The configuration sets them; core/supervise enforces them.
#pragma once

#include <chrono>
#include <cstdint>

namespace arhost::base {

struct RestartLimits {
    std::uint32_t proven_after_frames = 10; // frames in total, see RestartPolicy
    std::uint32_t quarantine_after = 5;     // consecutive failures after which a component is disabled
    std::chrono::milliseconds first_delay{250};
    std::chrono::milliseconds longest_delay{10'000};
};

struct Limits {
    // Each report of progress restarts the first three.
    std::chrono::milliseconds start{10'000};
    std::chrono::milliseconds frame{5'000}; // for each command
    std::chrono::milliseconds stop{30'000};
    // Limits of the whole start, the whole stop, and a whole command to a tracker or ray tracer. Reports of progress
    // do not restart them. Sources and sinks wait for others, so their commands have no such limit.
    static constexpr int total_factor = 30; // configurations set this multiple of the first three
    std::chrono::milliseconds start_total{total_factor * start}, frame_total{total_factor * frame},
        stop_total{total_factor * stop};
    RestartLimits restart;
};

} // namespace arhost::base
