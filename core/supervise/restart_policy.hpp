// SPDX-License-Identifier: Apache-2.0
//
// Decides when a dead component is restarted, and when it is quarantined.
#pragma once

#include "base/limits.hpp"

#include <chrono>
#include <cstdint>
#include <optional>

namespace arhost::supervise {

class RestartPolicy {
public:
    explicit RestartPolicy(const base::RestartLimits &limits) : limits_(limits) {}

    void frame_done() { ++frames_in_process_, ++frames_total_; }

    // Call when the process has died. Returns the delay before the next start; nullopt: quarantine.
    //
    // A component that is proven (proven_after_frames in total) and completed a frame in this process restarts at
    // once, however often it dies. Any other death is a failure: the back-off doubles from first_delay to
    // longest_delay. `jitter`, 0 to 1, adds up to a quarter, so that components that share a failed device don't
    // restart in step.
    std::optional<std::chrono::milliseconds> delay_after_death(double jitter);

    std::uint32_t failures() const { return failures_; }

private:
    base::RestartLimits limits_;
    std::uint64_t frames_in_process_ = 0, frames_total_ = 0;
    std::uint32_t failures_ = 0;
};

} // namespace arhost::supervise
