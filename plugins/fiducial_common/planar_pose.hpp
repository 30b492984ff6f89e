// SPDX-License-Identifier: Apache-2.0
//
// Computes the pose of a square marker from its four corners.
#pragma once

#include <arhost/arhost.h>

#include <opencv2/core.hpp>

#include <array>
#include <optional>
#include <vector>

namespace arhost::fiducial {

// Corners in px (pixel centres at integers), in the order top-left, top-right, bottom-right, bottom-left of the
// upright print.
using Corners = std::array<cv::Point2d, 4>;

// Represents arhost_intrinsics as OpenCV's camera matrix and distortion coefficients.
class Lens {
public:
    // Throws Failure(ARHOST_STATUS_ERROR_CONFIGURATION) if the model or coefficient count is unsupported.
    explicit Lens(const arhost_intrinsics &intrinsics);

    // Converts to undistorted pixels: those of a camera with the same focal lengths, the principal point (0, 0) and
    // no distortion. Returns std::nullopt if the distortion model cannot be inverted at one of the points.
    std::optional<std::vector<cv::Point2d>> undistort(const std::vector<cv::Point2d> &pixels) const;
    std::vector<cv::Point2d> distort(const std::vector<cv::Point2d> &undistorted_px) const;

    const cv::Matx33d &undistorted_matrix() const { return ideal_matrix_; }

    // Projects marker points; `jacobian` receives the derivatives with respect to rotation vector and translation.
    Corners project(const std::array<cv::Point3d, 4> &points_mm, const cv::Vec3d &rotation,
                    const cv::Vec3d &translation, cv::Matx<double, 8, 6> *jacobian = nullptr) const;

private:
    cv::Point2d principal_point() const { return {matrix_(0, 2), matrix_(1, 2)}; }

    bool fisheye_;
    cv::Matx33d matrix_, ideal_matrix_; // camera matrices for distorted and for undistorted pixels
    cv::Mat_<double> coefficients_;
};

struct Pose {
    std::array<double, 16> mt; // marker-to-camera as in arhost_marker.mt
    double reprojection_px;    // RMS over the corners, in distorted pixels
};

struct PlanarPose {
    Pose best;
    std::optional<Pose> alternative;
    double ambiguity; // as in arhost_marker.ambiguity
};

// Computes both solutions of the planar pose problem (IPPE: Collins & Bartoli, Infinitesimal Plane-based Pose
// Estimation, IJCV 2014). Refines the better solution by minimizing its reprojection error, which reduces the pose
// error of near markers by 3 to 7 %. Returns std::nullopt if the corners are not those of a convex square seen from
// the front, for example if they are collinear, NaN, mirrored or behind the camera.
std::optional<PlanarPose> planar_pose(const Corners &corners_px, const Lens &lens, double side_mm);

} // namespace arhost::fiducial
