// SPDX-License-Identifier: Apache-2.0
//
// The frames of a recorded session, which a run repeats (docs/sessions.md).
#pragma once

#include "session/log.hpp"

#include <map>
#include <string>
#include <vector>

namespace arhost::run_config {

// Frame i of the source is frames[i].
struct Recording {
    std::vector<session::RecordedFrame> frames;
    // True: the run uses the recorded poses, and a frame gets an overlay only if it had one in the recorded run.
    // False: frames are tracked and rendered as in any other run.
    bool repeats_decisions = true;
    std::map<std::string, std::string> plugin_ids; // of "tracker" and "raytracer", if the session has them
};

} // namespace arhost::run_config
