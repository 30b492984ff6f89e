// SPDX-License-Identifier: Apache-2.0
#include "pose/planar.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace arhost::pose {
namespace {

// A similarity that moves points to their centroid and scales them to a mean distance of √2, for a well-conditioned
// linear system (Hartley, In Defense of the Eight-Point Algorithm, IEEE PAMI 1997).
struct Normalization {
    Eigen::Vector2d centre = Eigen::Vector2d::Zero();
    double scale = 1;

    Eigen::Vector2d operator()(const Eigen::Vector2d &p) const { return scale * (p - centre); }
    Eigen::Matrix3d matrix() const {
        return (Eigen::Matrix3d() << scale, 0, -scale * centre.x(), 0, scale, -scale * centre.y(), 0, 0, 1)
            .finished();
    }
};

template <class Get> Normalization normalization(std::span<const PlanePoint> points, Get get) {
    Normalization result;
    for (const PlanePoint &point : points)
        result.centre += get(point) / static_cast<double>(points.size());
    double mean = 0;
    for (const PlanePoint &point : points)
        mean += (get(point) - result.centre).norm() / static_cast<double>(points.size());
    result.scale = std::numbers::sqrt2 / mean;
    return result;
}

// Returns the homography from the target's plane to the image. Uses the direct linear transform.
std::optional<Eigen::Matrix3d> homography(std::span<const PlanePoint> points) {
    const auto on_target = normalization(points, [](const PlanePoint &p) { return p.on_target_mm; }),
               on_image = normalization(points, [](const PlanePoint &p) { return p.on_image; });
    if (!std::isfinite(on_target.scale) || !std::isfinite(on_image.scale))
        return {};
    Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
    for (const PlanePoint &point : points) {
        const Eigen::Vector2d a = on_target(point.on_target_mm), b = on_image(point.on_image);
        Eigen::Matrix<double, 2, 9> rows;
        rows << a.x(), a.y(), 1, 0, 0, 0, -b.x() * a.x(), -b.x() * a.y(), -b.x(), //
            0, 0, 0, a.x(), a.y(), 1, -b.y() * a.x(), -b.y() * a.y(), -b.y();
        normal += rows.transpose() * rows;
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> solver(normal);
    if (solver.info() != Eigen::Success || !(solver.eigenvalues()[1] > 1e-9 * solver.eigenvalues()[8]))
        return {}; // more than one homography fits
    const Eigen::Matrix3d normalized =
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(solver.eigenvectors().col(0).eval().data());
    return Eigen::Matrix3d(on_image.matrix().inverse() * normalized * on_target.matrix());
}

// Returns the translation that minimizes the algebraic error of the points for a given rotation.
Eigen::Vector3d translation_for(const Eigen::Matrix3d &rotation, std::span<const PlanePoint> points) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const PlanePoint &point : points) {
        const Eigen::Vector3d turned = rotation.leftCols<2>() * point.on_target_mm;
        Eigen::Matrix<double, 2, 3> rows;
        rows << 1, 0, -point.on_image.x(), 0, 1, -point.on_image.y();
        normal += rows.transpose() * rows;
        right += rows.transpose() * (point.on_image * turned.z() - turned.head<2>());
    }
    return normal.ldlt().solve(right);
}

double squared_error(const Rigid &pose, std::span<const PlanePoint> points) {
    double sum = 0;
    for (const PlanePoint &point : points) {
        const Eigen::Vector3d p = pose.rotation.leftCols<2>() * point.on_target_mm + pose.translation_mm;
        sum += (p.head<2>() / p.z() - point.on_image).squaredNorm();
    }
    return sum;
}

} // namespace

std::optional<std::array<Rigid, 2>> planar_poses(std::span<const PlanePoint> points) {
    if (points.size() < 4)
        return {};
    // IPPE approximates the homography to first order at one point. The centroid is the best point for this.
    Eigen::Vector2d centre = Eigen::Vector2d::Zero();
    for (const PlanePoint &point : points)
        centre += point.on_target_mm / static_cast<double>(points.size());
    std::vector<PlanePoint> centred(points.begin(), points.end());
    for (PlanePoint &point : centred)
        point.on_target_mm -= centre;
    const auto h = homography(centred);
    if (!h || !(std::abs((*h)(2, 2)) > 1e-12 * h->norm()))
        return {};
    const Eigen::Matrix3d H = *h / (*h)(2, 2);

    // The image of the centre, and the derivative of the homography at the centre.
    const Eigen::Vector2d v = H.topRightCorner<2, 1>();
    const Eigen::Matrix2d J = H.topLeftCorner<2, 2>() - v * H.bottomLeftCorner<1, 2>();
    // turn·(0, 0, 1) is the direction of v.
    const Eigen::Matrix3d turn =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), v.homogeneous()).toRotationMatrix();
    Eigen::Matrix<double, 2, 3> projection; // derivative of the projection at v, up to the depth
    projection << Eigen::Matrix2d::Identity(), -v;
    const Eigen::Matrix2d A = (projection * turn.leftCols<2>()).inverse() * J;
    const double scale = A.jacobiSvd().singularValues()[0];
    if (!(scale > 0) || !std::isfinite(scale))
        return {};
    const Eigen::Matrix2d upper = A / scale;
    // The columns (upper; b) of the rotation are orthonormal: upperᵀ·upper + b·bᵀ = 1.
    const Eigen::Matrix2d remainder = Eigen::Matrix2d::Identity() - upper.transpose() * upper;
    Eigen::Vector2d b(std::sqrt(std::max(remainder(0, 0), 0.0)), std::sqrt(std::max(remainder(1, 1), 0.0)));
    if (remainder(0, 1) < 0)
        b.y() = -b.y();

    std::array<Rigid, 2> solutions;
    for (Rigid &solution : solutions) {
        Eigen::Matrix3d columns;
        columns.leftCols<2>() << upper, b.transpose();
        columns.col(2) = columns.col(0).cross(columns.col(1));
        solution.rotation = orthonormal(turn * columns);
        solution.translation_mm = translation_for(solution.rotation, centred);
        b = -b;
    }
    if (squared_error(solutions[1], centred) < squared_error(solutions[0], centred))
        std::swap(solutions[0], solutions[1]);
    for (Rigid &solution : solutions)
        solution.translation_mm -= solution.rotation.leftCols<2>() * centre;
    return solutions;
}

} // namespace arhost::pose
