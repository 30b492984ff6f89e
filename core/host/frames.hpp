// SPDX-License-Identifier: Apache-2.0
//
// A video frame in the pipeline, and the validation of what workers report about it.
#pragma once

#include "compositor/compositor.hpp"
#include "host/quality.hpp"
#include "host/slots.hpp"
#include "host/statistics.hpp"
#include "model/target.hpp"
#include "run_config/recorded_session.hpp"

#include <arhost/sink.h>

#include <array>
#include <chrono>
#include <memory>
#include <optional>
#include <vector>

namespace arhost::host {

struct Frame {
    using Clock = std::chrono::steady_clock;

    enum class Stage {
        to_track,  // waiting for the tracker
        tracking,  // being processed by the tracker
        to_render, // has a camera; waiting for the ray tracer
        rendering, // being processed by the ray tracer
        done       // ready for compositing, with or without `overlay`
    };

    explicit Frame(std::uint64_t sequence) {
        record.struct_size = sizeof record;
        record.sequence = sequence;
        record.overlay = ARHOST_OVERLAY_NONE;
    }

    Stage stage = Stage::to_track;
    bool overtaken = false; // mode live: a newer frame was shown; this one is dropped when its worker returns it
    const run_config::RecordedFrame *recorded = nullptr; // of a session that is replayed
    bool held = false;                                   // uses the camera of an earlier frame
    std::uint32_t attempts = 0; // how often the worker died while processing this frame in the current stage
    Lease pixels;               // slot in the source's memory
    Lease result;               // slot in the tracker's memory, while tracking
    Lease anchors;              // slot that the ray tracer reads, while rendering
    Lease overlay;              // slot in the ray tracer's memory
    arhost_render_info render{};
    Quality quality;                    // of the overlay
    arhost_record record{};             // without the arrays and their lengths
    std::vector<arhost_target> targets; // those seen so far
    std::vector<arhost_observation> observations;
    std::vector<arhost_expected_marker> expected;
    std::optional<std::array<double, 16>> world;              // the pose of the scene, as arhost_target.mt
    std::optional<std::size_t> pixels_sample, overlay_sample; // hashes for the contract checks
    Clock::time_point captured; // arrival, unless the source reports capture times of CLOCK_MONOTONIC
    Clock::time_point received;
    FrameTimes times; // `shown` and `latency` are not set here

    bool in_worker() const { return stage == Stage::tracking || stage == Stage::rendering; }
};

// Returns the current time of CLOCK_MONOTONIC.
inline std::int64_t monotonic_ns() {
    return std::chrono::nanoseconds(Frame::Clock::now().time_since_epoch()).count();
}

// A composited frame. Shared by all sinks that have not written it yet.
struct OutputFrame {
    std::uint64_t sequence;
    Lease slot;
    Frame::Clock::time_point captured; // as in Frame
    Quality quality;                   // of the overlay
    std::uint32_t inputs;              // what `slot` has: ARHOST_CAPABILITY_VIDEO_INPUT, _OVERLAY_INPUT
};
using OutputFramePointer = std::shared_ptr<const OutputFrame>;

// Copies a tracker's result into the frame and validates the copy. Returns nullptr if the copy is valid (finite
// numbers, valid poses, indices in range), otherwise a description of the contract violation. Does not set
// `search.unlisted_count`.
const char *accept_tracker_result(std::span<const std::byte> slot, const std::vector<model::Target> &configured,
                                  std::size_t family_count, Frame &frame);

// Copies and validates a source's frame info, which the host received at `now_ns` of CLOCK_MONOTONIC. Returns nullptr
// or the contract violation. Rejects capture times far in the future, because later frames with correct times would
// then seem to run backwards.
const char *accept_frame_info(const arhost_frame_info &info, std::int64_t previous_capture_ns, std::int64_t now_ns,
                              arhost_record &record);

// Returns the reported device time of an image. Returns 0 if none was reported or if it is longer than `busy`, the
// duration of the render call.
std::chrono::nanoseconds device_time(const arhost_render_info &info, std::chrono::nanoseconds busy);

} // namespace arhost::host
