// SPDX-License-Identifier: Apache-2.0
//
// The pose of a square marker from its four corners.
#pragma once

#include <arhost/arhost.h>

#include <opencv2/core.hpp>

#include <array>
#include <optional>
#include <vector>

namespace arhost::planar {

// Pixels, centres at integers; top-left, top-right, bottom-right, bottom-left of the upright print.
using Corners = std::array<cv::Point2d, 4>;

// An arhost_intrinsics in OpenCV's terms.
class Lens {
public:
    // Throws Failure(ARHOST_STATUS_ERROR_CONFIGURATION) for a model or coefficient count that there is not.
    explicit Lens(const arhost_intrinsics &intrinsics);

    // Pixels as a camera of the same focal lengths without distortion, principal point (0, 0), would have
    // them; nothing where the model can't be inverted.
    std::optional<std::vector<cv::Point2d>> undistort(const std::vector<cv::Point2d> &pixels) const;
    std::vector<cv::Point2d> distort(const std::vector<cv::Point2d> &undistorted_px) const;

    const cv::Matx33d &undistorted_matrix() const { return ideal_matrix_; }

    // The pixels of marker points, and where asked for their 8×6 derivative by rotation vector and translation.
    Corners project(const std::array<cv::Point3d, 4> &points_mm, const cv::Vec3d &rotation,
                    const cv::Vec3d &translation, cv::Matx<double, 8, 6> *jacobian = nullptr) const;

private:
    cv::Point2d principal_point() const { return {matrix_(0, 2), matrix_(1, 2)}; }

    bool fisheye_;
    cv::Matx33d matrix_, ideal_matrix_; // the camera's, and of undistorted pixels
    cv::Mat_<double> coefficients_;
};

struct Pose {
    std::array<double, 16> mt; // marker-to-camera as in arhost_marker.mt
    double reprojection_px;    // RMS over the corners, distorted pixels
};

struct PlanarPose {
    Pose best;
    std::optional<Pose> alternative;
    double ambiguity; // as in arhost_marker.ambiguity
};

// Both solutions of the planar pose problem (IPPE: Collins & Bartoli, Infinitesimal Plane-based Pose
// Estimation, IJCV 2014), the better one refined to the least reprojection error, which takes 3 to 7 % off the
// error of near markers. Nothing where the corners bound no convex square seen from its front: collinear,
// NaN, mirrored, behind the camera.
std::optional<PlanarPose> planar_pose(const Corners &corners_px, const Lens &lens, double side_mm);

} // namespace arhost::planar
