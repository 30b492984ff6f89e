// SPDX-License-Identifier: Apache-2.0
//
// The pose of a target in one frame, from the corners of its markers.
#pragma once

#include "pose/projection.hpp"
#include "pose/rigid.hpp"

#include <array>
#include <span>
#include <vector>

namespace arhost::pose {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

// A point of a target, and the pixel at which it was observed with Gaussian noise of standard deviation sigma_px
// along each axis.
struct Correspondence {
    Eigen::Vector3d on_target_mm;
    Eigen::Vector2d pixel_px;
    double sigma_px;
};

// A marker of a target that was observed. Corners are in the ABI's order: top-left, top-right, bottom-right,
// bottom-left on the upright print. On the target, they form a plane convex quadrilateral.
struct ObservedMarker {
    std::array<Eigen::Vector3d, 4> corners_on_target_mm;
    std::array<Eigen::Vector2d, 4> corners_px;
    double corner_sigma_px;
};

struct Estimate {
    Rigid camera_from_target;
    Matrix6d covariance;     // of translation (mm) and rotation (rad), in camera axes: the true pose is
                             // {rotation_by(r)·rotation, translation_mm + t} with (t, r) from this distribution
    double reprojection_px;  // RMS over the corners that are no outliers
    double normalized_error; // sum of the squared errors, each divided by its sigma_px; an outlier counts as an error
                             // of 5 times the noise
    std::size_t outliers;    // corners that do not fit the others and were left out
    std::size_t freedom;     // degrees of freedom: coordinates of the other corners, less the 6 of the pose
};

// Minimizes the reprojection error with the Levenberg–Marquardt method, starting at `start`. With more than four
// correspondences, first finds the outliers with Tukey's biweight loss: corners whose error exceeds 5 times the
// noise. The median error determines the noise. Returns nullopt if a point gets behind the camera or the solution is
// not unique. The covariance is computed from sigma_px and from the residuals; the weight of sigma_px decreases with
// the number of corners.
std::optional<Estimate> refine(const Rigid &start, std::span<const Correspondence> points,
                               const Projection &projection);

// Returns errors and covariance of a known pose, as refine() does, without changing it.
std::optional<Estimate> assess(const Rigid &pose, std::span<const Correspondence> points,
                               const Projection &projection);

// Returns the pose of smallest error, and a second one if the reprojection error has another local minimum. Returns
// nothing if no pose shows the front of a marker at its corners, for example if they are not convex, mirrored, or
// NaN. Corners may be wrong, as long as more than half of them are right.
std::vector<Estimate> estimate_poses(std::span<const ObservedMarker> markers, const Projection &projection);

// The corners of a square marker in its own frame: origin at the centre, x right, y up, z out of the print.
std::array<Eigen::Vector3d, 4> square_corners_mm(double side_mm);

} // namespace arhost::pose
