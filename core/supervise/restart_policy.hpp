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
    // A component is proven when it has completed proven_after_frames in total. A proven component restarts at once,
    // however often it dies, if the dead process completed at least one frame. (If such a component has lost its
    // device three times within a minute, Component switches to the fallback, if there is one.) Any other death
    // counts as a failure: the delay starts at first_delay and doubles with each failure up to longest_delay; after
    // quarantine_after failures in a row, the component is disabled. `jitter` (0 to 1) adds up to a quarter of the
    // delay, so that components that share a failed device do not restart at the same time.
    std::optional<std::chrono::milliseconds> delay_after_death(double jitter);

    // Call this instead if the process of a live source has died because its device is lost. The device may return
    // after any time, so such a death does not count as a failure: the delay starts at 0 and grows up to
    // longest_wait.
    std::chrono::milliseconds delay_while_device_is_lost(double jitter);

    std::uint32_t failures() const { return failures_; }
    bool has_completed_frames() const { return frames_total_ > 0; }

private:
    static constexpr std::chrono::milliseconds longest_wait{2000}; // so that a camera is soon used when it is back

    std::chrono::milliseconds back_off(std::uint32_t failures, std::chrono::milliseconds longest,
                                       double jitter) const;

    base::RestartLimits limits_;
    std::uint64_t frames_in_process_ = 0, frames_total_ = 0;
    std::uint32_t failures_ = 0, waits_ = 0; // waits_: consecutive processes that have not found the device
};

} // namespace arhost::supervise
