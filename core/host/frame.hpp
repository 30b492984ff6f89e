// SPDX-License-Identifier: Apache-2.0
//
// A video frame on its way through a run.
#pragma once

#include "compositor/compositor.hpp"
#include "host/quality.hpp"
#include "host/slots.hpp"
#include "host/statistics.hpp"
#include "session/log.hpp"

#include <arhost/sink.h>

#include <array>
#include <chrono>
#include <memory>
#include <optional>
#include <vector>

namespace arhost::host {

struct Frame {
    using Clock = std::chrono::steady_clock;

    // docs/images/frame-states.svg
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
    bool overtaken = false; // mode live: a newer frame was shown, so this frame is dropped when its worker returns it
    const session::RecordedFrame *recorded = nullptr; // record of this frame in the session that is replayed
    bool held = false;                                // uses the camera of an earlier frame
    std::uint32_t attempts = 0; // how often the worker died while processing this frame in the current stage
    Lease pixels;               // slot in the source's memory
    Lease result;               // slot in the tracker's memory, while tracking
    Lease anchors;              // slot that the ray tracer reads, while rendering
    Lease overlay;              // slot in the ray tracer's memory
    arhost_render_info render{};
    OverlayFormat overlay_format;       // of the worker that rendered the overlay
    Quality quality;                    // quality of the overlay
    arhost_record record{};             // without the arrays and their lengths
    std::vector<arhost_target> targets; // the targets that have been seen so far
    std::vector<arhost_observation> observations;
    std::vector<arhost_expected_marker> expected;
    std::optional<std::array<double, 16>> world;              // the pose of the world, as arhost_target.mt
    std::optional<std::size_t> pixels_sample, overlay_sample; // hashes for the contract checks
    Clock::time_point captured; // arrival, unless the source reports capture times of CLOCK_MONOTONIC
    Clock::time_point received;
    FrameTimes times; // `shown` and `latency` are not set here

    bool in_worker() const { return stage == Stage::tracking || stage == Stage::rendering; }
    // Returns the memory of components that have not finished the frame.
    void release_results() {
        result = Lease();
        anchors = Lease();
        overlay = Lease();
    }
    bool has_overlay() const { return record.overlay != ARHOST_OVERLAY_NONE; }
};

inline bool is_visible(const arhost_target &target) {
    return target.state != ARHOST_TARGET_LOST;
}

// A composited frame. Shared by all sinks that have not written it yet.
struct OutputFrame {
    std::uint64_t sequence;
    Lease slot;
    Frame::Clock::time_point captured; // as Frame::captured
    std::uint64_t inputs;              // what `slot` has: ARHOST_SINK_CAPABILITY_VIDEO_INPUT, _OVERLAY_INPUT
};
using OutputFramePointer = std::shared_ptr<const OutputFrame>;

} // namespace arhost::host
