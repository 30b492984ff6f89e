// SPDX-License-Identifier: Apache-2.0
//
// A video frame on its way through the pipeline.
#pragma once

#include "compositor/lens_warp.hpp"
#include "host/slots.hpp"
#include "host/statistics.hpp"

#include <arhost/sink.h>

#include <chrono>
#include <memory>
#include <optional>
#include <set>

namespace arhost::host {

struct Frame {
    using Clock = std::chrono::steady_clock;

    enum class Stage {
        to_track,  // waits for the tracker
        tracking,  // the tracker has it
        to_render, // has a camera, waits for the ray tracer
        rendering, // the ray tracer has it
        done       // can be composited, with `overlay` or without
    };

    Stage stage = Stage::to_track;
    bool overtaken = false;  // live: a newer frame has been shown; forget it once its worker lets go
    bool held = false;       // its camera is that of an earlier frame
    std::uint32_t tries = 0; // by the stage that has it, ended by the worker's death
    Lease pixels;            // in the source's memory
    Lease result;            // in the tracker's, while it has the frame
    Lease overlay;           // in the ray tracer's
    arhost_render_info render{};
    std::shared_ptr<LensWarp> warp; // what the overlay is yet to be bent by; NULL: nothing
    arhost_record record{};
    std::optional<std::size_t> pixels_sample, overlay_sample; // where promises are looked at
    Clock::time_point received;
    FrameTimes times; // but for `shown` and `latency`

    bool in_worker() const { return stage == Stage::tracking || stage == Stage::rendering; }
};

// An augmented frame, held by the sinks that have yet to write it.
struct OutputFrame {
    std::uint64_t sequence;
    Lease slot;
};
using OutputFramePointer = std::shared_ptr<const OutputFrame>;

// Takes a tracker's result out of its memory into the record. Returns what is wrong with it, or nullptr;
// then every marker has a known id of its own, finite numbers and a valid pose.
const char *take_tracker_result(std::span<const std::byte> slot, const std::set<std::int32_t> &ids,
                                arhost_record &record);

// Likewise what a source tells of a frame that has come at `now_ns` of CLOCK_MONOTONIC. A time of the far future is
// refused since all the right ones after it would run backwards.
const char *take_frame_info(const arhost_frame_info &info, std::int64_t previous_capture_ns, std::int64_t now_ns,
                            arhost_record &record);

// The device's time of an image that took the ray tracer `busy`. 0 where it tells none, or a longer one than that,
// which can't be true.
std::chrono::nanoseconds device_time(const arhost_render_info &info, std::chrono::nanoseconds busy);

} // namespace arhost::host
