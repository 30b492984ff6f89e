// SPDX-License-Identifier: Apache-2.0
#include "host/world.hpp"

#include "host/frame.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <string_view>
#include <tuple>
#include <vector>

namespace arhost::host {
namespace {

using pose::Matrix6d;
using pose::Rigid;
using Estimate = World::Estimate;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// Two poses contradict each other if their squared Mahalanobis distance is greater. Its mean is 6 for errors as their
// covariances tell.
constexpr double max_distance2 = 40;

// Returns the pose of a target. Its covariance is positive definite, whatever the tracker reports.
Estimate estimate_of(const arhost_target &target) {
    // Standard deviations of translations relative to the distance, and of rotations in rad. Calibrations and prints
    // cause errors of `least`, also if the corners have no noise.
    constexpr double least = 3e-4, unknown = 0.01, greatest = 1;
    const Eigen::Map<const Eigen::Matrix4d> mt(target.mt);
    const Rigid pose{mt.topLeftCorner<3, 3>(), mt.topRightCorner<3, 1>()};
    const double distance_mm = std::max(pose.translation_mm.norm(), 1.0);
    Vector6d scale = Vector6d::Ones();
    scale.head<3>().setConstant(distance_mm);
    Matrix6d relative = scale.cwiseInverse().asDiagonal() * Eigen::Map<const Matrix6d>(target.covariance) *
                        scale.cwiseInverse().asDiagonal();
    if (relative.isZero(0))
        relative.diagonal().setConstant(unknown * unknown);
    const Eigen::SelfAdjointEigenSolver<Matrix6d> axes(relative);
    const Vector6d variances = axes.eigenvalues().cwiseMax(least * least).cwiseMin(greatest * greatest);
    relative = axes.eigenvectors() * variances.asDiagonal() * axes.eigenvectors().transpose();
    return {pose, scale.asDiagonal() * relative * scale.asDiagonal()};
}

// Returns the covariance for a point at `to_mm` from the one to which the translations of `covariance` belong.
Matrix6d moved(const Matrix6d &covariance, const Eigen::Vector3d &to_mm) {
    Matrix6d by_error = Matrix6d::Identity();
    by_error.topRightCorner<3, 3>() = -pose::cross_matrix(to_mm);
    return by_error * covariance * by_error.transpose();
}

Matrix6d rotated(const Matrix6d &covariance, const Eigen::Matrix3d &rotation) {
    Matrix6d both = Matrix6d::Zero();
    both.topLeftCorner<3, 3>() = both.bottomRightCorner<3, 3>() = rotation;
    return both * covariance * both.transpose();
}

Estimate world_relative_to(const Estimate &target, const Estimate &world) {
    const Eigen::Vector3d to_world_mm = world.pose.translation_mm - target.pose.translation_mm;
    return {target.pose.inverse() * world.pose,
            rotated(world.covariance + moved(target.covariance, to_world_mm), target.pose.rotation.transpose())};
}

Estimate world_from(const Estimate &target, const Estimate &target_from_world) {
    const Rigid world = target.pose * target_from_world.pose;
    return {world, moved(target.covariance, world.translation_mm - target.pose.translation_mm) +
                       rotated(target_from_world.covariance, target.pose.rotation)};
}

Vector6d difference(const Estimate &a, const Estimate &b) {
    Vector6d error;
    error << a.pose.translation_mm - b.pose.translation_mm,
        pose::rotation_vector(a.pose.rotation * b.pose.rotation.transpose());
    return error;
}

bool agree(const Estimate &a, const Estimate &b) {
    const Vector6d error = difference(a, b);
    return error.dot((a.covariance + b.covariance).ldlt().solve(error)) <= max_distance2;
}

// Returns the mean of two independent estimates, weighted by their covariances.
Estimate fused(const Estimate &a, const Estimate &b) {
    const Matrix6d gain = (a.covariance + b.covariance).ldlt().solve(a.covariance).transpose();
    const Vector6d change = gain * difference(b, a);
    const Matrix6d covariance = a.covariance - gain * a.covariance;
    return {{pose::orthonormal(pose::rotation_by(change.tail<3>()) * a.pose.rotation),
             a.pose.translation_mm + change.head<3>()},
            (covariance + covariance.transpose()) / 2};
}

bool is_ambiguous(const arhost_target &target) {
    constexpr double max_ambiguity = 0.5;
    return target.ambiguity > max_ambiguity;
}

} // namespace

// Averages the pose of the first target relative to another one. If the targets have moved, begins again.
void World::learn(const arhost_target &first, const arhost_target &target, std::uint64_t frame) {
    constexpr double memory = 0.95; // weight of the earlier frames, because errors of successive frames are related
    const Relation measured{world_relative_to(estimate_of(target), estimate_of(first)),
                            is_ambiguous(first) || is_ambiguous(target), frame};
    const auto [known, is_new] = relations_.try_emplace(target.name, measured);
    Relation &relation = known->second;
    Estimate &mean = relation.target_from_world;
    const bool is_better = relation.is_ambiguous && !measured.is_ambiguous,
               is_worse = measured.is_ambiguous && !relation.is_ambiguous,
               agrees = agree(mean, measured.target_from_world);
    if (is_better || (!agrees && !is_worse)) {
        relation = measured;
    } else if (agrees) {
        relation.frame = frame;
        if (is_new || is_worse)
            return;
        mean.covariance /= memory;
        mean = fused(mean, measured.target_from_world);
    }
}

std::optional<std::array<double, 16>> World::locate(const std::string &first, std::span<const arhost_target> targets,
                                                    std::uint64_t frame, std::uint64_t grace_frames) {
    std::array<double, 16> world;
    if (const auto own = std::ranges::find_if(
            targets, [&](const auto &target) { return is_visible(target) && target.name == first; });
        own != targets.end()) {
        followed_.clear();
        for (const arhost_target &target : targets)
            if (&target != &*own && target.state == ARHOST_TARGET_DETECTED && own->state == ARHOST_TARGET_DETECTED)
                learn(*own, target, frame);
        std::ranges::copy(own->mt, world.begin());
        return world;
    }

    struct Candidate {
        const arhost_target *target;
        Estimate world;
        // Less is better. A target that was followed in the last frame has not been moved out of view.
        std::tuple<bool, bool, double, std::string_view> order;
    };
    std::vector<Candidate> candidates;
    for (const arhost_target &target : targets) {
        const auto relation = relations_.find(target.name);
        if (!is_visible(target) || relation == relations_.end() || frame - relation->second.frame > grace_frames)
            continue;
        const Estimate located = world_from(estimate_of(target), relation->second.target_from_world);
        candidates.push_back({&target,
                              located,
                              {is_ambiguous(target) || relation->second.is_ambiguous,
                               !followed_.contains(target.name), located.covariance.determinant(), target.name}});
    }
    if (candidates.empty())
        return {};
    std::ranges::sort(candidates, {}, &Candidate::order);
    Estimate mean = candidates.front().world;
    followed_ = {candidates.front().target->name};
    for (const Candidate &other : std::span(candidates).subspan(1)) {
        if (std::get<0>(other.order) || !agree(mean, other.world)) // ambiguous, or moved
            continue;
        mean = fused(mean, other.world);
        followed_.insert(other.target->name);
    }
    Eigen::Map<Eigen::Matrix4d> mt(world.data());
    mt.setIdentity();
    mt.topLeftCorner<3, 3>() = pose::orthonormal(mean.pose.rotation);
    mt.topRightCorner<3, 1>() = mean.pose.translation_mm;
    return world;
}

} // namespace arhost::host
