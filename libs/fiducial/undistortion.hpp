// SPDX-License-Identifier: Apache-2.0
//
// Converts between pixels of a camera and undistorted pixels. Undistorted pixels are those of a camera with the same
// focal lengths, the principal point (0, 0) and no distortion. Pixel centres are at integers.
#pragma once

#include <arhost/shading/lens.hpp>

#include <opencv2/core.hpp>

#include <optional>
#include <vector>

namespace arhost::fiducial {

class Lens {
public:
    // Throws Failure(ARHOST_STATUS_ERROR_CONFIGURATION) if the model or coefficient count is unsupported.
    explicit Lens(const arhost_intrinsics &intrinsics);

    // Both functions return std::nullopt if the distortion model is not one-to-one at one of the points.
    std::optional<std::vector<cv::Point2d>> undistort(const std::vector<cv::Point2d> &pixels) const;
    std::optional<std::vector<cv::Point2d>> distort(const std::vector<cv::Point2d> &undistorted_px) const;

    cv::Vec2d focal_px() const { return {fx_, fy_}; }

private:
    double fx_, fy_;
    shading::Lens lens_;
};

// Returns the factor by which the distortion enlarges the noise of a square's corners. It equals the factor by which
// the square is enlarged.
double noise_scale(const std::vector<cv::Point2d> &undistorted_px, const std::vector<cv::Point2d> &distorted_px);

} // namespace arhost::fiducial
