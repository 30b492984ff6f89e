// SPDX-License-Identifier: Apache-2.0
//
// When a component that has died is started again, and when no more.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace arhost::supervise {

struct RestartLimits {
    std::uint32_t proven_after_frames = 10;
    std::uint32_t quarantine_after = 5; // failures
    std::chrono::milliseconds first_delay{250};
    std::chrono::milliseconds longest_delay{10'000};
};

class RestartPolicy {
public:
    explicit RestartPolicy(const RestartLimits &limits) : limits_(limits) {}

    void frame_done() { ++frames_in_life_, ++frames_ever_; }

    // The process has died. How long to wait before the next one, or nothing: quarantine.
    //
    // A component that has shown that it works (proven_after_frames, ever) and that worked in this life
    // (a frame) restarts at once, however often it dies. Any other death is a failure: the delay doubles
    // from first_delay to longest_delay. `jitter`, 0 to 1, adds up to a quarter, so that several
    // components that share a broken device don't restart in step.
    std::optional<std::chrono::milliseconds> died(double jitter);

    std::uint32_t failures() const { return failures_; }

private:
    RestartLimits limits_;
    std::uint64_t frames_in_life_ = 0, frames_ever_ = 0;
    std::uint32_t failures_ = 0;
};

} // namespace arhost::supervise
