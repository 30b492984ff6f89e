// SPDX-License-Identifier: Apache-2.0
#include "sender_clock.hpp"

#include <algorithm>

namespace arhost {

std::int64_t SenderClock::capture_ns(std::optional<std::int64_t> sender_ns, std::int64_t arrival_ns) {
    std::int64_t capture_ns = arrival_ns;
    if (sender_ns) {
        const std::int64_t candidate_ns = arrival_ns - *sender_ns;
        const bool is_new_epoch = !offset_ns_ || *sender_ns < last_sender_ns_;
        const std::int64_t drift_ns = (arrival_ns - last_arrival_ns_) / 2000;
        offset_ns_ = is_new_epoch ? candidate_ns : std::min(candidate_ns, *offset_ns_ + drift_ns);
        capture_ns = *offset_ns_ + *sender_ns;
        last_sender_ns_ = *sender_ns;
    }
    last_arrival_ns_ = arrival_ns;
    return last_capture_ns_ = std::max(capture_ns, std::min(last_capture_ns_ + 1, arrival_ns));
}

} // namespace arhost
