// SPDX-License-Identifier: Apache-2.0
//
// Measures how long a camera has delivered no intact frame.
#pragma once

#include <algorithm>
#include <chrono>
#include <utility>

namespace arhost {

class Silence {
public:
    using Clock = std::chrono::steady_clock;
    static constexpr std::chrono::seconds limit{5}; // a camera that is silent for longer is reported as lost

    explicit Silence(Clock::time_point now = Clock::now()) : last_check_(now) {}

    // Call this several times per second. A longer interval between two calls counts as only one second, because it
    // means that the process, and possibly the camera, was suspended (for example by suspend-to-RAM, a frozen
    // container or Ctrl-Z).
    bool exceeds_limit(Clock::time_point now = Clock::now()) {
        constexpr Clock::duration longest_interval = std::chrono::seconds(1);
        duration_ += std::min(now - std::exchange(last_check_, now), longest_interval);
        return duration_ > limit;
    }

private:
    Clock::time_point last_check_;
    Clock::duration duration_{};
};

} // namespace arhost
