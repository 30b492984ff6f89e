// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

namespace arhost {

// Maps a sender's time stamps to CLOCK_MONOTONIC. The results ascend and are never after the arrival.
//
// A picture arrives after a delay that varies. The picture with the shortest delay shows best how far the clocks are
// apart, so the offset is the minimum of arrival − time stamp. It may rise by 500 ppm, more than the drift of quartz
// clocks, so that it also follows a sender whose clock is slow. The shortest delay itself is unknown, and remains in
// the result: the capture time of the fastest picture is its arrival.
class SenderClock {
public:
    // `sender_ns`: the time stamp on any clock; nullopt: the sender has none, so the result is the arrival.
    std::int64_t capture_ns(std::optional<std::int64_t> sender_ns, std::int64_t arrival_ns);

    // For a new connection, whose time stamps have another epoch.
    void restart() { offset_ns_.reset(); }

private:
    std::optional<std::int64_t> offset_ns_;
    std::int64_t last_sender_ns_ = 0, last_arrival_ns_ = 0, last_capture_ns_ = 0;
};

} // namespace arhost
