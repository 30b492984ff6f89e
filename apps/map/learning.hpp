// SPDX-License-Identifier: Apache-2.0
//
// Learns where markers are relative to each other from the images of a calibrated camera: bundle adjustment of the
// camera's poses and the markers' poses. Each marker is a plane square of known side.
#pragma once

#include "pose/estimate.hpp"

#include <array>
#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace arhost::map {

struct Detection {
    int id;
    std::array<Eigen::Vector2d, 4> corners_px; // in the ABI's order
};

struct Frame {
    std::string name; // for messages
    std::vector<Detection> detections;
};

struct Marker {
    int id;
    double side_mm;
    pose::Rigid map_from_marker; // marker axes: origin at the centre, x right, y up, z out of the print
};

struct Settings {
    std::map<int, double> sides_mm; // sides of all markers that may be detected; other markers are ignored
    std::optional<int> origin;      // the map's frame is that of this marker; default: the smallest id
    std::vector<Marker> layout; // initial estimate; the map's frame is that of the layout, unless `origin` is given
    bool is_plane = false;      // turn the map's frame so that z = 0 is the plane that fits the corners best
    // Called between steps, with a text that describes the current step; may throw to stop.
    std::function<void(const std::string &)> progress = [](const std::string &) {};
};

struct LearnedMarker : Marker {
    std::size_t views = 0;         // frames that show the marker together with other markers, and in which it fits
    std::size_t misfits = 0;       // frames in which the marker is elsewhere, because it was moved, hidden or misread
    double rms_px = 0;             // RMS of the corners' reprojection errors in the views that fit
    double position_sigma_mm = 0;  // standard deviation, in the direction in which it is largest, relative to
    double rotation_sigma_rad = 0; // the marker that fixes the frame
    bool is_ambiguous = false;     // another tilt fits the images nearly as well
};

struct Refusal {
    int id;
    std::string reason; // such as "was seen in only 2 frames; …"
};

struct Map {
    std::vector<LearnedMarker> markers; // by ascending id; empty if no marker was seen together with another one
    std::vector<Refusal> refused;       // by ascending id
    std::vector<std::string> misfits;   // names of frames in which most markers do not fit
    std::size_t frames = 0;             // frames that were used
    int origin = 0;                     // the marker that fixes the frame
    double rms_px = 0;                  // over the corners of all views that fit
};

// Throws std::runtime_error if the marker `origin`, or none of the layout's markers, can be in the map.
Map learn(const std::vector<Frame> &frames, const arhost_intrinsics &camera, const Settings &settings);

inline constexpr std::size_t min_views = 3; // minimum number of views of a marker in the map together with others

} // namespace arhost::map
