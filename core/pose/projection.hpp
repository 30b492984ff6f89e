// SPDX-License-Identifier: Apache-2.0
//
// Projection of points to pixels with its derivative.
#pragma once

#include <arhost/shading/lens.hpp>

#include <Eigen/Dense>

#include <optional>

namespace arhost::pose {

using Jacobian23 = Eigen::Matrix<double, 2, 3>;

class Projection {
public:
    explicit Projection(const arhost_intrinsics &intrinsics) : intrinsics_(intrinsics), lens_(intrinsics) {}

    // Returns the pixel of a point in camera axes; nullopt if the lens does not see it. `derivative` receives the
    // derivative of the pixel with respect to the point, in px/mm.
    std::optional<Eigen::Vector2d> pixel(const Eigen::Vector3d &point_mm, Jacobian23 *derivative = nullptr) const;

    // Returns the point of the plane z = 1 that is seen at a pixel: the pixel of an ideal pinhole camera with focal
    // length 1. Returns nullopt if there is none: outside the lens's image, or 89° and more off the axis.
    std::optional<Eigen::Vector2d> on_plane(const Eigen::Vector2d &pixel_px) const;

    const arhost_intrinsics &intrinsics() const { return intrinsics_; }

private:
    arhost_intrinsics intrinsics_;
    shading::Lens lens_;
};

} // namespace arhost::pose
