// SPDX-License-Identifier: Apache-2.0
#include "pose/projection.hpp"

namespace arhost::pose {

std::optional<Eigen::Vector2d> Projection::pixel(const Eigen::Vector3d &point_mm, Jacobian23 *derivative) const {
    const auto project = [&](const Eigen::Vector3d &p) -> std::optional<Eigen::Vector2d> {
        const auto px = lens_.project({p.x(), p.y(), p.z()});
        if (!px)
            return {};
        return Eigen::Vector2d(px->x, px->y);
    };
    auto px = project(point_mm);
    if (!px || !derivative)
        return px;
    if (intrinsics_.distortion == ARHOST_DISTORTION_NONE) {
        const double fx = intrinsics_.fx / point_mm.z(), fy = intrinsics_.fy / point_mm.z();
        *derivative << fx, 0, -fx * point_mm.x() / point_mm.z(), 0, fy, -fy * point_mm.y() / point_mm.z();
        return px;
    }
    const double step = 1e-6 * point_mm.norm(); // balances truncation and rounding error
    for (int axis = 0; axis < 3; ++axis) {
        const auto after = project(point_mm + step * Eigen::Vector3d::Unit(axis)),
                   before = project(point_mm - step * Eigen::Vector3d::Unit(axis));
        if (!after || !before)
            return {};
        derivative->col(axis) = (*after - *before) / (2 * step);
    }
    return px;
}

std::optional<Eigen::Vector2d> Projection::on_plane(const Eigen::Vector2d &pixel_px) const {
    const auto ray = lens_.ray({pixel_px.x(), pixel_px.y()});
    if (!ray || !(ray->z > 0.0175 * std::hypot(ray->x, ray->y))) // cot 89°
        return {};
    return Eigen::Vector2d(ray->x / ray->z, ray->y / ray->z);
}

} // namespace arhost::pose
