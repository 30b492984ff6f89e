// SPDX-License-Identifier: Apache-2.0
//
// Reads images, videos and cameras, and finds the board in them.
#pragma once

#include "calibrate/collector.hpp"
#include "plugin_tools/workers.hpp"

#include <filesystem>

namespace arhost::calibrate {

struct Views {
    cv::Size image; // px
    std::vector<View> views;
    std::vector<std::string> without_board; // names of images
    std::string summary;                    // describes the frames of a video or camera
    std::string seen_instead;               // see Board; only if there are no views
};

// The workers that decode, and a signalfd whose signals interrupt the reading.
struct Reading {
    plugin_tools::Workers &workers;
    int signals;
};

// These functions throw std::runtime_error, whose message names the file and the problem, or base::Interrupted.

Views views_of_images(const Reading &reading, const std::vector<std::filesystem::path> &files, const Board &board);
// Takes at most `limit` views.
Views views_of_video(const Reading &reading, const std::filesystem::path &file, const Board &board, Model model,
                     std::size_t limit);

struct CameraOptions {
    std::string name; // device, file or URL
    cv::Size size;    // empty: the camera's default
    bool with_window = true;
};

// Prints advice to the person who holds the board, until the views are complete or `limit` is reached, or until
// Ctrl-C or the key q in the window. SIGTERM and SIGHUP interrupt it.
Views views_of_camera(const Reading &reading, const CameraOptions &camera, const Board &board, Model model,
                      std::size_t limit);

} // namespace arhost::calibrate
