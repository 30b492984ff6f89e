// SPDX-License-Identifier: Apache-2.0
//
// The Cramér–Rao bound of the pose of a square marker.
#pragma once

#include "pose/estimate.hpp"

namespace arhost::bench {

// The smallest possible covariance of an unbiased estimate of the pose, in the form of Estimate::covariance: the
// inverse of the Fisher information at the true pose. `noise_px`: standard deviation of each coordinate of a corner.
inline pose::Matrix6d cramer_rao(const pose::Rigid &truth, const pose::Projection &projection, double side_mm,
                                 double noise_px) {
    pose::Matrix6d information = pose::Matrix6d::Zero();
    for (const Eigen::Vector3d &corner : pose::square_corners_mm(side_mm)) {
        pose::Jacobian23 derivative;
        projection.pixel(truth * corner, &derivative);
        Eigen::Matrix<double, 2, 6> jacobian;
        jacobian << derivative, -derivative * pose::cross_matrix(truth.rotation * corner);
        information += jacobian.transpose() * jacobian / (noise_px * noise_px);
    }
    return information.inverse();
}

} // namespace arhost::bench
