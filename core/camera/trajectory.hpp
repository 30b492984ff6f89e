// SPDX-License-Identifier: Apache-2.0
//
// The cameras of a run, to be traced again: as the ray tracer had them, after the mapping, in the scene's
// world. Two formats (docs/trajectories.md): arhost's own, which the plugin sink_trajectory writes, and the
// dissertation's.
#pragma once

#include <arhost/camera.h>
#include <arhost/frame.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace arhost::camera {

// Where a camera is and how it is turned: the fields of arhost_camera.
struct View {
    double eye_mm[3], look_at_mm[3], up[3];
};

struct TrajectoryFrame {
    std::uint64_t frame; // its number in the run
    std::int64_t capture_ns;
    std::optional<View> view; // none: no marker was in view
};

struct Trajectory {
    std::vector<TrajectoryFrame> frames; // at least one, ascending; frames that the run dropped are not there
    // None where the file has no time stamps; capture_ns is then that of `fps` frames a second from 0 on.
    std::optional<arhost_clock> clock;
    double fps = 0;                              // nominal; 0 where unknown
    std::optional<arhost_intrinsics> intrinsics; // none where the file does not tell them
    std::string warning;                         // "", or what was wrong but can be lived with, for the user

    // The first frame with this number or a higher one, or nullptr.
    const TrajectoryFrame *at_or_after(std::uint64_t frame) const;
    std::uint64_t end() const { return frames.back().frame + 1; }
};

// Tells the formats apart by the first character. A last line that was cut short is left out, with a
// warning; all other faults throw yaml::Error, which names file, line, column and what to mend.
Trajectory read_trajectory(const std::filesystem::path &file);

arhost_camera camera_of(const View &view, const arhost_intrinsics &intrinsics);

} // namespace arhost::camera
