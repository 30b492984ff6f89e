// SPDX-License-Identifier: Apache-2.0
//
// The frames of a recorded session, which a run repeats (docs/sessions.md).
#pragma once

#include "camera/trajectory.hpp"

#include <arhost/sink.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace arhost::run_config {

// The record of a frame in a session's log: data that the video does not contain, and the decisions of the recorded
// run.
struct RecordedFrame {
    std::uint64_t number; // number in the recorded run; frames that the recorded run dropped are missing
    std::int64_t capture_ns;
    arhost_clock clock;
    arhost_overlay overlay;
    double scale;          // quality of the overlay, as in host::Quality
    std::uint32_t samples; // samples per pixel, as in host::Quality
    std::vector<arhost_target> targets;
    std::vector<arhost_observation> observations; // observations of markers that belong to targets
    arhost_search search{};
    std::optional<camera::View> view;
    std::optional<std::pair<std::string, std::array<double, 16>>> truth; // truth_target and true_mt of arhost_record
};

// Frame i of the source is frames[i].
struct Recording {
    std::vector<RecordedFrame> frames;
    // True: the run uses the recorded poses, and a frame gets an overlay only if it had one in the recorded run.
    // False: frames are tracked and rendered as in any other run.
    bool repeats_decisions = true;
};

} // namespace arhost::run_config
