// SPDX-License-Identifier: Apache-2.0
//
// A Kalman filter for a pose that moves at a nearly constant velocity.
#pragma once

#include "pose/estimate.hpp"

namespace arhost::pose {

// Pose and velocity in camera axes, with covariances. Plain data without pointers, because it is kept in shared
// memory across restarts.
struct Motion {
    double rotation[9], angular_velocity_rad_s[3]; // matrices are column-major
    double translation_mm[3], velocity_mm_s[3];
    // turn: rotation and angular velocity; shift: translation and velocity.
    double turn_covariance[36], shift_covariance[36];
};

Motion begin_motion(const Estimate &first);

// Returns the motion `seconds` later (≥ 0). The covariance grows by the possible effect of a hand's accelerations.
Motion predicted(Motion motion, double seconds);

// Returns the motion after a measured pose. The covariance determines the weight of the measurement in each
// direction. For example, the variance of a marker's tilt is much larger than that of the marker's position in the
// image.
Motion corrected(Motion motion, const Estimate &measured);

// Returns the squared Mahalanobis distance of a measured rotation from the predicted one. If the measurement belongs
// to this motion, the mean of this distance is 3.
double rotation_distance2(const Motion &motion, const Estimate &measured);

Rigid pose_of(const Motion &motion);

// Returns the covariance of the position of a point of the target, in camera axes, mm².
Eigen::Matrix3d covariance_of(const Motion &motion, const Eigen::Vector3d &on_target_mm);

} // namespace arhost::pose
