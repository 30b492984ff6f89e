// SPDX-License-Identifier: Apache-2.0
//
// Converts times of a camera's clock to CLOCK_MONOTONIC.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

namespace arhost::uvc {

// A linear relation between the camera's clock and the host's clock. Each sample consists of a camera time and its
// arrival at the host, which is late by an unknown, non-negative delay. The line therefore lies below all samples: it
// is the edge of their lower convex hull at their mean (Moon, Skelly, Towsley: "Estimation and Removal of Clock Skew
// from Network Delay Measurements", INFOCOM 1999). Late samples do not affect the line.
class DeviceClock {
public:
    explicit DeviceClock(std::uint32_t frequency_hz) : frequency_hz_(frequency_hz) {}

    void add(std::uint32_t ticks, std::int64_t arrival_ns);

    // Returns the host's time. Returns std::nullopt if the relation is unknown, because there are too few samples or
    // the clock does not run at the stated frequency.
    std::optional<std::int64_t> host_ns(std::uint32_t ticks) const;

private:
    struct Sample {
        std::int64_t device_ns; // computed from the stated frequency; continues after the counter's overflow
        std::int64_t arrival_ns;
    };
    std::int64_t device_ns(std::int64_t ticks) const;
    void fit();

    std::uint32_t frequency_hz_;
    std::uint32_t last_ticks_ = 0;
    std::int64_t total_ticks_ = 0; // continues after the counter's overflow
    std::deque<Sample> samples_;
    // host = origin.arrival_ns + offset_ns_ + rate_ * (device − origin.device_ns)
    Sample origin_{};
    double offset_ns_ = 0, rate_ = 1;
    bool is_known_ = false;
};

// The capture times of frames: the camera's time if its clock is known, otherwise the arrival. The capture times
// never decrease and are never later than the arrival.
class CaptureTimes {
public:
    explicit CaptureTimes(std::uint32_t frequency_hz) : clock_(frequency_hz) {}

    void add_clock(std::uint32_t ticks, std::int64_t arrival_ns) { clock_.add(ticks, arrival_ns); }
    std::int64_t time_of(std::optional<std::uint32_t> presentation_ticks, std::int64_t arrival_ns);

private:
    DeviceClock clock_;
    std::int64_t last_ns_ = 0;
};

} // namespace arhost::uvc
