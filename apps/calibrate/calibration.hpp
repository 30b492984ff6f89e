// SPDX-License-Identifier: Apache-2.0
//
// Computes the intrinsics of a camera from views of a board.
#pragma once

#include "calibrate/board.hpp"

#include <array>
#include <span>

namespace arhost::calibrate {

enum class Model { brown, fisheye }; // OpenCV's models with k1 k2 p1 p2 k3, and with k1 k2 k3 k4

struct Lens {
    Model model = Model::brown;
    cv::Matx33d matrix = cv::Matx33d::eye();
    std::vector<double> coefficients;
};

// Angles between board and image plane. A positive tilt about the image's vertical axis means that the right side of
// the board is nearer to the camera. A positive tilt about the horizontal axis means that the lower side is nearer.
struct Tilt {
    double about_vertical_degrees = 0, about_horizontal_degrees = 0;
};

// Returns the tilt of a board in a camera with this lens.
Tilt tilt_of(const View &view, const Lens &lens);
// Returns a lens without distortion and with a field of view of 53 degrees, for use until the real lens is known.
Lens assumed_lens(const cv::Size &image);

struct UsedView {
    std::size_t index; // index in the list of views
    double error_px;   // RMS over the corners
    Tilt tilt;
    std::vector<cv::Point2f> corners_px; // without removed corners
    std::vector<double> residuals_px;    // for each corner
    std::size_t left_out;                // number of removed corners, whose errors were far above those of the others
};

struct DroppedView {
    std::size_t index;
    double error_px;
};

struct Calibration {
    cv::Size image; // px
    Lens lens;
    std::array<double, 4> deviations_px; // standard deviations of fx, fy, cx, cy
    double error_px;                     // RMS over all corners
    std::vector<UsedView> used;
    std::vector<DroppedView> dropped; // views whose errors were far above those of the other views
};

constexpr std::size_t fewest_views = 3; // minimum for a unique solution of the equations

// Throws std::runtime_error if there are fewer than fewest_views, or if OpenCV finds no solution.
Calibration calibrate(std::span<const View> views, const cv::Size &image, Model model);

} // namespace arhost::calibrate
