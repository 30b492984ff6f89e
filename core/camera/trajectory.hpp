// SPDX-License-Identifier: Apache-2.0
//
// Reads the recorded cameras of a run, which can then be replayed. The cameras are in scene coordinates, as the ray
// tracer received them. There are two formats (docs/trajectories.md): the one that the plugin sink_trajectory writes,
// and the one of the dissertation.
#pragma once

#include <arhost/camera.h>
#include <arhost/frame.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace arhost::camera {

// Camera position and orientation: the fields of arhost_camera.
struct View {
    double eye_mm[3], look_at_mm[3], up[3];
};

// Returns "" if ray tracers can use the view, otherwise a description of the problem.
std::string problem_with(const View &view);

struct TrajectoryFrame {
    std::uint64_t frame; // frame number in the run
    std::int64_t capture_ns;
    std::optional<View> view; // nullopt if no target was visible
};

struct Trajectory {
    std::vector<TrajectoryFrame>
        frames; // at least one; by ascending frame number; frames that the run dropped are missing
    // nullopt if the file has no timestamps; capture_ns is then computed from 0 at `fps` frames per second.
    std::optional<arhost_clock> clock;
    double fps = 0;                              // nominal frame rate; 0: unknown
    std::optional<arhost_intrinsics> intrinsics; // nullopt if the file lacks them
    std::string warning;                         // message about a non-fatal problem, or ""

    // Returns the first frame whose number is at least `frame`, or nullptr.
    const TrajectoryFrame *at_or_after(std::uint64_t frame) const;
    std::uint64_t end() const { return frames.back().frame + 1; }
};

// Reads a file in either format, which is detected from the first character. A truncated last line is ignored and
// results in a warning. Any other problem is thrown as yaml::Error, whose message names file, line and column, and
// how to fix the problem.
Trajectory read_trajectory(const std::filesystem::path &file);

arhost_camera camera_of(const View &view, const arhost_intrinsics &intrinsics);

} // namespace arhost::camera
