// SPDX-License-Identifier: Apache-2.0
//
// The planar pose problem: the pose of a plane from at least four of its points has up to two solutions that project
// the points to almost the same pixels.
#pragma once

#include "pose/rigid.hpp"

#include <array>
#include <optional>
#include <span>

namespace arhost::pose {

// A point of a target's plane z = 0 and the point of the camera's plane z = 1 at which it is seen.
struct PlanePoint {
    Eigen::Vector2d on_target_mm, on_image;
};

// Computes both solutions with IPPE (Collins and Bartoli, Infinitesimal Plane-based Pose Estimation, IJCV 2014),
// the one with the smaller error first. They are equal if the plane is parallel to the image. Returns nullopt if the
// points do not determine a homography.
std::optional<std::array<Rigid, 2>> planar_poses(std::span<const PlanePoint> points);

} // namespace arhost::pose
