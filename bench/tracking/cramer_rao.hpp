// SPDX-License-Identifier: Apache-2.0
//
// The Cramér–Rao bound of the pose of a square marker.
#pragma once

#include "pose/estimate.hpp"

#include <array>

namespace arhost::bench {

// The derivatives of the corners' coordinates by the pose, in the form of Estimate::covariance.
inline Eigen::Matrix<double, 8, 6> corner_derivatives(const pose::Rigid &truth, const pose::Projection &projection,
                                                      double side_mm) {
    Eigen::Matrix<double, 8, 6> derivatives;
    int row = 0;
    for (const Eigen::Vector3d &corner : pose::square_corners_mm(side_mm)) {
        pose::Jacobian23 derivative;
        projection.pixel(truth * corner, &derivative);
        derivatives.middleRows<2>(row) << derivative, -derivative * pose::cross_matrix(truth.rotation * corner);
        row += 2;
    }
    return derivatives;
}

// The smallest possible covariance of an unbiased estimate of the pose: the inverse of the Fisher information at the
// true pose. `noise_px`: standard deviation of each coordinate of a corner; all are independent.
inline pose::Matrix6d cramer_rao(const pose::Rigid &truth, const pose::Projection &projection, double side_mm,
                                 double noise_px) {
    const auto derivatives = corner_derivatives(truth, projection, side_mm);
    return noise_px * noise_px * (derivatives.transpose() * derivatives).inverse();
}

// The same if the corners are the intersections of four lines, each fitted to points along its edge that have
// independent errors. The variance of the offset at the middle of an edge is then inversely proportional to its
// length, that of the offset at its ends relative to the middle is three times as large, and the errors of
// neighbouring corners are correlated. `noise_px`: RMS of the coordinates' standard deviations.
inline pose::Matrix6d cramer_rao_of_edges(const pose::Rigid &truth, const pose::Projection &projection,
                                          double side_mm, double noise_px) {
    const auto corners_mm = pose::square_corners_mm(side_mm);
    std::array<Eigen::Vector2d, 4> corners;
    for (std::size_t i = 0; i < 4; ++i)
        corners[i] = projection.pixel(truth * corners_mm[i]).value();
    // Edge i begins at corner i: its normal, and the variances of its offset at the middle and of its turn.
    std::array<Eigen::Vector2d, 4> normals;
    Eigen::Matrix<double, 8, 1> variances;
    for (int i = 0; i < 4; ++i) {
        const Eigen::Vector2d edge = corners[(i + 1) % 4] - corners[i];
        normals[i] = Eigen::Vector2d(-edge.y(), edge.x()).normalized();
        variances.segment<2>(2 * i) << 1 / edge.norm(), 3 / edge.norm();
    }
    Eigen::Matrix<double, 8, 8> corners_by_edges = Eigen::Matrix<double, 8, 8>::Zero();
    for (int i = 0; i < 4; ++i) {
        const int before = (i + 3) % 4; // the edge that ends at this corner
        Eigen::Matrix2d lines;
        lines << normals[before].transpose(), normals[i].transpose();
        const Eigen::Matrix2d corner_by_offsets = lines.inverse();
        corners_by_edges.block<2, 2>(2 * i, 2 * before) = corner_by_offsets.col(0) * Eigen::RowVector2d(1, 1);
        corners_by_edges.block<2, 2>(2 * i, 2 * i) = corner_by_offsets.col(1) * Eigen::RowVector2d(1, -1);
    }
    Eigen::Matrix<double, 8, 8> covariance = corners_by_edges * variances.asDiagonal() * corners_by_edges.transpose();
    covariance *= noise_px * noise_px / (covariance.trace() / 8);
    const auto derivatives = corner_derivatives(truth, projection, side_mm);
    return (derivatives.transpose() * covariance.ldlt().solve(derivatives)).inverse();
}

} // namespace arhost::bench
