// SPDX-License-Identifier: Apache-2.0
#include "pose/motion_filter.hpp"

namespace arhost::pose {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using CovarianceMap = Eigen::Map<Matrix6d>;

// Standard deviations of the accelerations of a hand, and of its unknown speed in the first frame.
constexpr double turn_acceleration_rad_s2 = 5, shift_acceleration_mm_s2 = 3000;
constexpr double first_turn_rad_s = 2, first_shift_mm_s = 500;

Eigen::Matrix3d rotation_covariance(const Estimate &estimate) {
    return estimate.covariance.bottomRightCorner<3, 3>();
}
Eigen::Matrix3d translation_covariance(const Estimate &estimate) {
    return estimate.covariance.topLeftCorner<3, 3>();
}

// Adds the effect of a random acceleration during a step.
void advance(CovarianceMap covariance, double seconds, double acceleration) {
    Matrix6d step = Matrix6d::Identity();
    step.topRightCorner<3, 3>().diagonal().setConstant(seconds);
    Eigen::Matrix<double, 6, 3> effect; // effect of an acceleration on value and velocity
    effect << seconds * seconds / 2 * Eigen::Matrix3d::Identity(), seconds * Eigen::Matrix3d::Identity();
    covariance = step * covariance * step.transpose() + acceleration * acceleration * effect * effect.transpose();
}

// Kalman update with a measurement of the value. Returns the correction of value and velocity.
Vector6d correct(CovarianceMap covariance, const Eigen::Vector3d &innovation, const Eigen::Matrix3d &noise) {
    const Eigen::Matrix3d total = covariance.topLeftCorner<3, 3>() + noise;
    const Eigen::Matrix<double, 6, 3> gain = total.ldlt().solve(covariance.topRows<3>()).transpose();
    const Matrix6d after = covariance - gain * covariance.topRows<3>();
    covariance = (after + after.transpose()) / 2;
    return gain * innovation;
}

} // namespace

Rigid pose_of(const Motion &motion) {
    return {Eigen::Map<const Eigen::Matrix3d>(motion.rotation),
            Eigen::Map<const Eigen::Vector3d>(motion.translation_mm)};
}

Eigen::Matrix3d covariance_of(const Motion &motion, const Eigen::Vector3d &on_target_mm) {
    const Eigen::Map<const Matrix6d> turn(motion.turn_covariance), shift(motion.shift_covariance);
    const Eigen::Matrix3d lever = cross_matrix(Eigen::Map<const Eigen::Matrix3d>(motion.rotation) * on_target_mm);
    return shift.topLeftCorner<3, 3>() + lever * turn.topLeftCorner<3, 3>() * lever.transpose();
}

Motion begin_motion(const Estimate &first) {
    Motion motion{};
    Eigen::Map<Eigen::Matrix3d>(motion.rotation) = first.camera_from_target.rotation;
    Eigen::Map<Eigen::Vector3d>(motion.translation_mm) = first.camera_from_target.translation_mm;
    CovarianceMap turn(motion.turn_covariance), shift(motion.shift_covariance);
    turn.topLeftCorner<3, 3>() = rotation_covariance(first);
    turn.bottomRightCorner<3, 3>().diagonal().setConstant(first_turn_rad_s * first_turn_rad_s);
    shift.topLeftCorner<3, 3>() = translation_covariance(first);
    shift.bottomRightCorner<3, 3>().diagonal().setConstant(first_shift_mm_s * first_shift_mm_s);
    return motion;
}

Motion predicted(Motion motion, double seconds) {
    Eigen::Map<Eigen::Matrix3d> rotation(motion.rotation);
    const Eigen::Map<const Eigen::Vector3d> turning(motion.angular_velocity_rad_s), moving(motion.velocity_mm_s);
    rotation = orthonormal(rotation_by(seconds * turning) * rotation);
    Eigen::Map<Eigen::Vector3d>(motion.translation_mm) += seconds * moving;
    advance(CovarianceMap(motion.turn_covariance), seconds, turn_acceleration_rad_s2);
    advance(CovarianceMap(motion.shift_covariance), seconds, shift_acceleration_mm_s2);
    return motion;
}

Motion corrected(Motion motion, const Estimate &measured) {
    Eigen::Map<Eigen::Matrix3d> rotation(motion.rotation);
    Eigen::Map<Eigen::Vector3d> translation(motion.translation_mm);
    const Vector6d turn = correct(CovarianceMap(motion.turn_covariance),
                                  rotation_vector(measured.camera_from_target.rotation * rotation.transpose()),
                                  rotation_covariance(measured));
    const Vector6d shift =
        correct(CovarianceMap(motion.shift_covariance), measured.camera_from_target.translation_mm - translation,
                translation_covariance(measured));
    rotation = orthonormal(rotation_by(turn.head<3>()) * rotation);
    Eigen::Map<Eigen::Vector3d>(motion.angular_velocity_rad_s) += turn.tail<3>();
    translation += shift.head<3>();
    Eigen::Map<Eigen::Vector3d>(motion.velocity_mm_s) += shift.tail<3>();
    return motion;
}

double rotation_distance2(const Motion &motion, const Estimate &measured) {
    const Eigen::Map<const Eigen::Matrix3d> rotation(motion.rotation);
    const Eigen::Vector3d innovation = rotation_vector(measured.camera_from_target.rotation * rotation.transpose());
    const Eigen::Matrix3d total =
        Eigen::Map<const Matrix6d>(motion.turn_covariance).topLeftCorner<3, 3>() + rotation_covariance(measured);
    return innovation.dot(total.ldlt().solve(innovation));
}

} // namespace arhost::pose
