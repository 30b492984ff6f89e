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
    double turn_covariance[36], shift_covariance[36]; // of rotation and angular velocity; of translation and velocity
};

Motion begin_motion(const Estimate &first);

// Returns the motion `seconds` later (≥ 0). The covariance grows by what accelerations of a hand can change.
Motion predicted(Motion motion, double seconds);

// The motion after a measured pose. Each direction is weighted by its covariance: that of a marker's tilt, for
// example, is much larger than that of its position in the image.
Motion corrected(Motion motion, const Estimate &measured);

// The squared Mahalanobis distance of a measured rotation from the predicted one: 3 on average for a measurement of
// this motion.
double rotation_distance2(const Motion &motion, const Estimate &measured);

Rigid pose_of(const Motion &motion);

// The covariance, in mm², of where a point of the target is, in camera axes.
Eigen::Matrix3d covariance_of(const Motion &motion, const Eigen::Vector3d &on_target_mm);

} // namespace arhost::pose
