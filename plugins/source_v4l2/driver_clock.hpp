// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "capture_device.hpp"

#include <arhost-cpp/plugin.hpp>

#include <cstdint>
#include <optional>

namespace arhost {

// Converts a driver's time stamps to CLOCK_MONOTONIC.
class DriverClock {
public:
    explicit DriverClock(const Host &host) : host_(host) {}

    // Returns the capture time in ns of CLOCK_MONOTONIC, which is at most the current time. If the driver uses
    // another clock, logs this once.
    std::int64_t monotonic_ns(const Capture &captured);
    // Returns the time since the capture; nullopt if the driver uses another clock.
    static std::optional<std::int64_t> age_ns(const Capture &captured);

private:
    Host host_;
    bool reported_ = false;
};

} // namespace arhost
