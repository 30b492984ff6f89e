// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "session/log.hpp"

namespace arhost::session::test {

// A frame without anything, and one with two targets, an observation and everything else.
inline Log full_log() {
    Log log;
    log.lacking = 3;
    log.is_complete = true;
    RecordedFrame frame{};
    frame.number = 4;
    frame.capture_ns = 1'000;
    frame.clock = ARHOST_CLOCK_MEDIA;
    frame.overlay = ARHOST_OVERLAY_NONE;
    frame.scale = 1;
    frame.shading_px = 1;
    log.frames.push_back(frame);
    frame.number = 6;
    frame.capture_ns = 2'000;
    frame.overlay = ARHOST_OVERLAY_RENDERED;
    frame.scale = 0.5;
    frame.samples = 16;
    frame.shading_px = 2;
    for (const char *name : {"cup", "lid"}) {
        arhost_target target{};
        target.struct_size = sizeof target;
        std::string(name).copy(target.name, sizeof target.name - 1);
        target.state = ARHOST_TARGET_DETECTED;
        for (const int diagonal : {0, 5, 10, 15})
            target.mt[diagonal] = 1;
        target.covariance[35] = 8;
        target.ambiguity = 0.5;
        frame.targets.push_back(target);
    }
    arhost_observation observation{};
    observation.struct_size = sizeof observation;
    observation.id = 7;
    observation.corners_px[2][1] = 4;
    frame.observations.push_back(observation);
    frame.targets[0].observation_count = 1;
    frame.targets[1].first_observation = 1;
    frame.search.candidate_count = 6;
    frame.view = camera::View{{1, 2, 3.5}, {1, 2, 2.5}, {0, 1, 0}};
    frame.truth.emplace("cup", std::array<double, 16>{1});
    log.frames.push_back(frame);
    return log;
}

} // namespace arhost::session::test
