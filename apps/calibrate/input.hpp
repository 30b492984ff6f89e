// SPDX-License-Identifier: Apache-2.0
//
// Reads images, videos and cameras, and finds the board in them.
#pragma once

#include "calibrate/collector.hpp"

#include <filesystem>

namespace arhost::calibrate {

struct Views {
    cv::Size image; // px
    std::vector<View> views;
    std::vector<std::string> without_board; // names of images
    std::string summary;                    // describes the frames of a video or camera
    std::string seen_instead;               // see Board; only if there are no views
};

// These functions throw std::runtime_error, whose message names the file and the problem.

Views views_of_images(const std::vector<std::filesystem::path> &files, const Board &board);
// Takes at most `limit` views.
Views views_of_video(const std::filesystem::path &file, const Board &board, Model model, std::size_t limit);

struct CameraOptions {
    std::string name; // device, file or URL
    cv::Size size;    // empty: the camera's default
    bool with_window = true;
};

// Prints advice to the person who holds the board, until the views are complete or `limit` is reached, or until
// Ctrl-C or the key q in the window.
Views views_of_camera(const CameraOptions &camera, const Board &board, Model model, std::size_t limit);

} // namespace arhost::calibrate
