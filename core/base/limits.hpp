// SPDX-License-Identifier: Apache-2.0
//
// Deadlines and restarts of a supervised worker: set by the configuration, enforced by core/supervise.
#pragma once

#include <chrono>
#include <cstdint>

namespace arhost::base {

struct RestartLimits {
    std::uint32_t proven_after_frames = 10;
    std::uint32_t quarantine_after = 5; // consecutive failures before giving up
    std::chrono::milliseconds first_delay{250};
    std::chrono::milliseconds longest_delay{10'000};
};

struct Limits {
    std::chrono::milliseconds start{10'000}; // since the last sign of progress
    std::chrono::milliseconds frame{5'000};  // for one command
    std::chrono::milliseconds stop{30'000};  // since the last sign of progress
    RestartLimits restart;
};

} // namespace arhost::base
