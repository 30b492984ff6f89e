// SPDX-License-Identifier: Apache-2.0
//
// The scene and the configuration that put a model on a marker.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace arhost::place {

// The values are those of the command line.
struct Placement {
    std::filesystem::path model;
    std::string target;                 // FAMILY:ID, or a pattern file of ARToolKit
    double side_mm = 80;                // of the marker
    std::optional<double> fit_mm;       // largest side of the model; absent: side_mm
    std::string source = "/dev/video0"; // a device, a URL, or a file
    std::filesystem::path camera;       // calibration; empty: that of a typical webcam
    unsigned width = 0, height = 0;     // px, of the images of the calibration; 0: as in its file
    std::filesystem::path output;       // empty: a window
    std::string animation, variant;     // empty: none
    std::string raytracer = "rt_embree";
    std::string command_line; // for a comment
};

// `scene` and `configuration` are the files that the texts will be written to; paths in the texts are relative to
// their folders. Both throw base::InvalidInput.
std::string scene_text(const Placement &placement, const std::filesystem::path &scene);
std::string configuration_text(const Placement &placement, const std::filesystem::path &scene,
                               const std::filesystem::path &configuration);

} // namespace arhost::place
