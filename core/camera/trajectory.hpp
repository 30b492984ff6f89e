// SPDX-License-Identifier: Apache-2.0
//
// Recorded cameras of a run, for replay: as the ray tracer received them, after the mapping, in scene coordinates.
// Two formats (docs/trajectories.md): arhost's own, which the plugin sink_trajectory writes, and the dissertation's.
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

struct TrajectoryFrame {
    std::uint64_t frame; // frame number in the run
    std::int64_t capture_ns;
    std::optional<View> view; // none: no marker was visible
};

struct Trajectory {
    std::vector<TrajectoryFrame> frames; // at least one, ascending, without dropped frames
    // None if the file has no timestamps; capture_ns then counts from 0 at `fps` frames per second.
    std::optional<arhost_clock> clock;
    double fps = 0;                              // nominal; 0: unknown
    std::optional<arhost_intrinsics> intrinsics; // none if the file lacks them
    std::string warning;                         // "", or a non-fatal problem, for the user

    // The first frame with this or a higher number, or nullptr.
    const TrajectoryFrame *at_or_after(std::uint64_t frame) const;
    std::uint64_t end() const { return frames.back().frame + 1; }
};

// Detects the format by the first character. Ignores a truncated last line with a warning; any other problem throws
// yaml::Error, which names file, line, column and fix.
Trajectory read_trajectory(const std::filesystem::path &file);

arhost_camera camera_of(const View &view, const arhost_intrinsics &intrinsics);

} // namespace arhost::camera
