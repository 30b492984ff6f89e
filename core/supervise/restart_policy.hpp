// SPDX-License-Identifier: Apache-2.0
//
// Decides when a dead component is restarted, and when it is disabled, which means that it is not restarted again.
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

    // Call this when the process has died. Returns the delay before the next start, or nullopt if the component is to
    // be disabled.
    //
    // A component is proven when it has completed proven_after_frames in total. If it is proven and the dead process
    // completed at least one frame, it restarts at once, however often it dies; but Component replaces one that has
    // lost its device three times within a minute, if it has a fallback. Any other death counts as a failure: the
    // delay starts at first_delay and doubles with each failure up to longest_delay; after quarantine_after failures
    // in a row, the component is disabled. `jitter` (0 to 1) adds up to a quarter of the delay, so that components
    // that share a failed device do not restart at the same time.
    std::optional<std::chrono::milliseconds> delay_after_death(double jitter);

    std::uint32_t failures() const { return failures_; }

private:
    base::RestartLimits limits_;
    std::uint64_t frames_in_process_ = 0, frames_total_ = 0;
    std::uint32_t failures_ = 0;
};

} // namespace arhost::supervise
