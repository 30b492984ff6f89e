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
    return back_off(failures_, limits_.longest_delay, jitter);
}

std::chrono::milliseconds RestartPolicy::delay_while_device_is_lost(double jitter) {
    failures_ = 0;
    waits_ = frames_in_process_ > 0 ? 0 : waits_ + 1;
    frames_in_process_ = 0;
    return waits_ == 0 ? std::chrono::milliseconds(0)
                       : back_off(waits_, std::min(limits_.longest_delay, longest_wait), jitter);
}

std::chrono::milliseconds RestartPolicy::back_off(std::uint32_t failures, std::chrono::milliseconds longest,
                                                  double jitter) const {
    auto delay = limits_.first_delay;
    for (std::uint32_t i = 1; i < failures && delay < longest; ++i)
        delay *= 2;
    delay = std::min(delay, longest);
    return delay +
           std::chrono::milliseconds(static_cast<std::int64_t>(static_cast<double>(delay.count()) * jitter / 4));
}

} // namespace arhost::supervise
