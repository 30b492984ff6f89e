// SPDX-License-Identifier: Apache-2.0
#include "supervise/restart_policy.hpp"

#include <algorithm>

namespace arhost::supervise {

std::optional<std::chrono::milliseconds> RestartPolicy::delay_after_death(double jitter) {
    const bool proven = frames_total_ >= limits_.proven_after_frames && frames_in_process_ > 0;
    frames_in_process_ = 0;
    if (proven) {
        failures_ = 0;
        return std::chrono::milliseconds(0);
    }
    if (++failures_ >= limits_.quarantine_after)
        return std::nullopt;
    auto delay = limits_.first_delay;
    for (std::uint32_t i = 1; i < failures_ && delay < limits_.longest_delay; ++i)
        delay *= 2;
    delay = std::min(delay, limits_.longest_delay);
    return delay +
           std::chrono::milliseconds(static_cast<std::int64_t>(static_cast<double>(delay.count()) * jitter / 4));
}

} // namespace arhost::supervise
