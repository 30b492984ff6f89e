// SPDX-License-Identifier: Apache-2.0
#include "pose/smoothing.hpp"

#include <algorithm>
#include <cmath>

namespace arhost::pose {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr double max_gap_s = 0.25;
// Weight w of the newest pose while the target rests. The filter multiplies the noise by √(w/(2 − w)) = 0.42.
constexpr double resting_weight = 0.3;
// Weight of the newest innovation among the innovations.
constexpr double newest = 0.4;
// Limits of the squared length of the mean innovation, relative to the mean squared length. Below the first limit,
// the target rests; above the second, it moves. The expected value is about newest/(2 − newest) = 0.25 for noise, and
// 1 in steady motion without noise.
constexpr double resting_share = 0.3, moving_share = 0.55;
// Minimum length of an innovation that counts as a jump, relative to the root mean square of earlier innovations.
constexpr double jump = 5;

bool continues(const Smoothing &memory, std::int64_t capture_ns) {
    const double seconds = 1e-9 * (static_cast<double>(capture_ns) - static_cast<double>(memory.capture_ns));
    const Eigen::Map<const Eigen::Matrix3d> rotation(memory.rotation);
    const bool has_innovations = Eigen::Map<const Vector6d>(memory.innovations).allFinite() && memory.squares >= 0 &&
                                 std::isfinite(memory.squares) && memory.weights >= 0 && memory.weights <= 1;
    return has_innovations && seconds >= 0 && seconds <= max_gap_s &&
           (rotation * rotation.transpose()).isIdentity(1e-6) && rotation.determinant() > 0;
}

// Returns the weight of the newest pose. `share`: the quantity to which resting_share and moving_share refer.
double weight(double share) {
    const double x = std::clamp((share - resting_share) / (moving_share - resting_share), 0.0, 1.0);
    return resting_weight + (1 - resting_weight) * x * x * (3 - 2 * x);
}

} // namespace

Rigid smoothed(Smoothing &memory, const Estimate &measured, std::int64_t capture_ns) {
    Eigen::Map<Eigen::Matrix3d> rotation(memory.rotation);
    Eigen::Map<Eigen::Vector3d> translation(memory.translation_mm);
    Eigen::Map<Vector6d> innovations(memory.innovations);
    const auto restart = [&] {
        memory = {};
        memory.capture_ns = capture_ns;
        rotation = measured.camera_from_target.rotation;
        translation = measured.camera_from_target.translation_mm;
        return measured.camera_from_target;
    };
    if (!continues(memory, capture_ns))
        return restart();
    Vector6d innovation;
    innovation << measured.camera_from_target.translation_mm - translation,
        rotation_vector(measured.camera_from_target.rotation * rotation.transpose());
    const Eigen::LLT<Matrix6d> noise(measured.covariance);
    if (noise.info() != Eigen::Success)
        return restart();
    const Vector6d in_noise = noise.matrixL().solve(innovation);
    const double square = in_noise.squaredNorm();
    // At least the assumed noise, because the first innovations may be small by chance.
    const double mean_square = std::max(memory.weights > 0 ? memory.squares / memory.weights : 0, 6.0);
    if (!(square <= jump * jump * mean_square))
        return restart();
    innovations += newest * (in_noise - innovations);
    memory.squares += newest * (square - memory.squares);
    memory.weights += newest * (1 - memory.weights);
    const double share = square > 0 ? innovations.squaredNorm() / (memory.squares * memory.weights) : 0;
    const double w = weight(share);
    translation += w * innovation.head<3>();
    rotation = orthonormal(rotation_by(w * innovation.tail<3>()) * rotation);
    memory.capture_ns = capture_ns;
    return {rotation, translation};
}

} // namespace arhost::pose
