// SPDX-License-Identifier: Apache-2.0
//
// Rigid transforms. All of core/pose/ uses OpenCV's camera axes (x right, y down, z forward) and millimetres; only
// matrix_of and rigid_of convert to and from the ABI's OpenGL eye space (x right, y up, looking along −z).
#pragma once

#include <Eigen/Dense>

#include <array>
#include <cmath>
#include <span>

namespace arhost::pose {

// camera_from_target: maps a point p of the target to rotation·p + translation_mm in the camera's frame.
struct Rigid {
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();

    Eigen::Vector3d operator*(const Eigen::Vector3d &point_mm) const { return rotation * point_mm + translation_mm; }
    Rigid operator*(const Rigid &other) const {
        return {rotation * other.rotation, rotation * other.translation_mm + translation_mm};
    }
    Rigid inverse() const { return {rotation.transpose(), -(rotation.transpose() * translation_mm)}; }
};

// Returns the matrix [v]× with [v]×·w = v × w.
inline Eigen::Matrix3d cross_matrix(const Eigen::Vector3d &v) {
    return (Eigen::Matrix3d() << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0).finished();
}

// Returns the rotation by |vector| rad about `vector` (Rodrigues' formula).
inline Eigen::Matrix3d rotation_by(const Eigen::Vector3d &vector) {
    const double angle = vector.norm();
    if (angle < 1e-12)
        return Eigen::Matrix3d::Identity() + cross_matrix(vector);
    return Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix();
}

// Inverse of rotation_by. The returned vector has a length of at most π.
inline Eigen::Vector3d rotation_vector(const Eigen::Matrix3d &rotation) {
    const Eigen::AngleAxisd turn(rotation);
    return turn.angle() * turn.axis();
}

inline double angle_between_rad(const Eigen::Matrix3d &a, const Eigen::Matrix3d &b) {
    return Eigen::AngleAxisd(a.transpose() * b).angle();
}

// A rotation matrix near a matrix that differs from one only by rounding errors.
inline Eigen::Matrix3d orthonormal(const Eigen::Matrix3d &rotation) {
    return Eigen::Quaterniond(rotation).normalized().toRotationMatrix();
}

// Returns the pose as arhost_target.mt: column-major, in OpenGL eye space.
inline std::array<double, 16> matrix_of(const Rigid &pose) {
    std::array<double, 16> matrix{};
    Eigen::Map<Eigen::Matrix4d> m(matrix.data());
    const Eigen::Vector3d to_gl(1, -1, -1);
    m.topLeftCorner<3, 3>() = to_gl.asDiagonal() * pose.rotation;
    m.topRightCorner<3, 1>() = to_gl.cwiseProduct(pose.translation_mm);
    m(3, 3) = 1;
    return matrix;
}

inline Rigid rigid_of(std::span<const double, 16> matrix) {
    const Eigen::Map<const Eigen::Matrix4d> m(matrix.data());
    const Eigen::Vector3d from_gl(1, -1, -1);
    return {from_gl.asDiagonal() * m.topLeftCorner<3, 3>(), from_gl.cwiseProduct(m.topRightCorner<3, 1>())};
}

} // namespace arhost::pose
