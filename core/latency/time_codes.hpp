// SPDX-License-Identifier: Apache-2.0
//
// The pictures with which `arhost latency` measures the time from the camera's lens to the display. The camera is
// pointed at the window; each frame replaces the picture by the next one, and the tracker reports which picture a
// frame shows. A picture is a tag of the family tag36h11. An exposure may mix two tags, but the mixture is not
// mistaken for a third tag, because all tags differ in at least 11 of 36 cells.
#pragma once

#include "compositor/compositor.hpp"

#include <arhost/tracker.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <span>

namespace arhost::latency {

class TimeCodes {
public:
    using Clock = std::chrono::steady_clock;
    static constexpr std::int32_t count = 64; // pictures; their ids are 0 to count − 1

    explicit TimeCodes(Clock::time_point now) : last_seen_(now) {}

    // Fills the image with the next picture, whose time is `now`.
    void draw(const OutputView &out, std::uint32_t width, std::uint32_t height, Clock::time_point now);
    // Returns the age of the picture that a frame shows. Returns nullopt if it shows none or several, or if an
    // earlier frame has already shown it. Ages above the time of `count` frames are reported too low.
    std::optional<std::chrono::nanoseconds> see(std::span<const arhost_observation> seen, Clock::time_point now);
    // Whether no frame has shown a picture for the duration `limit`. Returns true at most once per `limit`.
    bool is_overdue(std::chrono::nanoseconds limit, Clock::time_point now);

private:
    struct Picture {
        Clock::time_point drawn{};
        bool is_seen = true; // also true before the picture is drawn for the first time
    };
    std::array<Picture, count> pictures_;
    std::uint64_t drawn_ = 0;
    Clock::time_point last_seen_; // time of the last picture that was seen, or of the last reminder
};

} // namespace arhost::latency
