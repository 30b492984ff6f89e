// SPDX-License-Identifier: Apache-2.0
//
// A video frame in the pipeline, and the validation of what workers report about it.
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
        tracking,  // in the tracker
        to_render, // waits for the ray tracer, with a camera
        rendering, // in the ray tracer
        done       // ready for compositing, with or without `overlay`
    };

    explicit Frame(std::uint64_t sequence) {
        record.struct_size = sizeof record;
        record.sequence = sequence;
        record.overlay = ARHOST_OVERLAY_NONE;
    }

    Stage stage = Stage::to_track;
    bool overtaken = false;     // live: a newer frame was shown; dropped once its worker returns it
    bool held = false;          // uses the camera of an earlier frame
    std::uint32_t attempts = 0; // of the current stage that ended with the worker's death
    Lease pixels;               // in the source's memory
    Lease result;               // in the tracker's memory, while tracking
    Lease overlay;              // in the ray tracer's memory
    arhost_render_info render{};
    std::shared_ptr<LensWarp> warp; // lens distortion to apply to the overlay, or null
    arhost_record record{};
    std::optional<std::size_t> pixels_sample, overlay_sample; // for contract checks
    Clock::time_point received;
    FrameTimes times; // except `shown` and `latency`

    bool in_worker() const { return stage == Stage::tracking || stage == Stage::rendering; }
};

// Now on CLOCK_MONOTONIC.
inline std::int64_t monotonic_ns() {
    return std::chrono::nanoseconds(Frame::Clock::now().time_since_epoch()).count();
}

// A composited frame, held by the sinks that have not written it yet.
struct OutputFrame {
    std::uint64_t sequence;
    Lease slot;
};
using OutputFramePointer = std::shared_ptr<const OutputFrame>;

// Copies a tracker's result into the record and validates the copy. Returns the contract violation, or nullptr; then
// the markers have known and unique ids, finite numbers and valid poses.
const char *accept_tracker_result(std::span<const std::byte> slot, const std::set<std::int32_t> &ids,
                                  arhost_record &record);

// Likewise for a source's frame info, received at `now_ns` of CLOCK_MONOTONIC. Rejects times far in the future, as
// all later correct times would then run backwards.
const char *accept_frame_info(const arhost_frame_info &info, std::int64_t previous_capture_ns, std::int64_t now_ns,
                              arhost_record &record);

// The reported device time of an image, or 0 if there is none or it exceeds `busy`, the duration of the render call.
std::chrono::nanoseconds device_time(const arhost_render_info &info, std::chrono::nanoseconds busy);

} // namespace arhost::host
