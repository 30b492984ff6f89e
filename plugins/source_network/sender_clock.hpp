// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

namespace arhost {

// Maps a sender's time stamps to CLOCK_MONOTONIC. The results increase and are never later than the arrival.
// Each picture arrives after a variable delay. The picture with the shortest delay indicates the offset between the
// clocks best, so the offset is the minimum of arrival − time stamp. To follow a sender whose clock is slow, the
// offset may rise by 500 ppm, which exceeds the drift of quartz clocks. The shortest delay itself is unknown and
// remains in the result: the capture time of the fastest picture equals its arrival.
class SenderClock {
public:
    // `sender_ns`: the time stamp by any clock; if it is nullopt, the result is the arrival.
    std::int64_t capture_ns(std::optional<std::int64_t> sender_ns, std::int64_t arrival_ns);

    // Call for a new connection, because its time stamps have another epoch.
    void restart() { offset_ns_.reset(); }

private:
    std::optional<std::int64_t> offset_ns_;
    std::int64_t last_sender_ns_ = 0, last_arrival_ns_ = 0, last_capture_ns_ = 0;
};

} // namespace arhost
