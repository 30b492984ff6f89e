// SPDX-License-Identifier: Apache-2.0
#include "view/orbit.hpp"

#include "view/bounds.hpp"

#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace arhost::view {
namespace {

// The front of a z-up world is −y, that of a y-up world +z.
glm::dmat3 axes_for(const glm::dvec3 &up) {
    const glm::dvec3 u = glm::normalize(up);
    const glm::dvec3 hint = std::abs(u.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 0, -1);
    const glm::dvec3 front = glm::normalize(glm::cross(hint, u));
    return {glm::cross(u, front), u, front};
}

} // namespace

double Lens::focal_px() const {
    return height / 2.0 / std::tan(glm::radians(vertical_degrees / 2));
}

Orbit::Orbit(const glm::dvec3 &eye, const glm::dvec3 &target, const glm::dvec3 &up)
    : target_(target), axes_(axes_for(up)), azimuth_(0), elevation_(0), distance_(glm::length(eye - target)) {
    const glm::dvec3 back = distance_ > 0 ? glm::transpose(axes_) * (eye - target) / distance_ : glm::dvec3(0, 0, 1);
    azimuth_ = std::atan2(back.x, back.z);
    elevation_ = std::asin(std::clamp(back.y, -1.0, 1.0));
    distance_ = std::max(distance_, 1e-9);
}

Orbit::Orbit(const scene::Box &box, const glm::dvec3 &up, const Lens &lens, bool from_all_sides)
    : Orbit(glm::dvec3(0), glm::dvec3(0), up) {
    constexpr double margin = 0.97; // share of the picture that the box takes
    const glm::dvec3 low(is_empty(box) ? glm::vec3(-50) : box.min), high(is_empty(box) ? glm::vec3(50) : box.max);
    target_ = (low + high) * 0.5;
    azimuth_ = glm::radians(30.0);
    elevation_ = glm::radians(20.0);
    distance_ = std::max(glm::length(high - low) * 1e-3, 1e-9);
    Orbit other = *this;
    for (int side = 0; side < (from_all_sides ? 36 : 1); ++side, other.turn(10, 0)) {
        for (int corner = 0; corner < 8; ++corner) {
            const glm::dvec3 at(corner & 1 ? high.x : low.x, corner & 2 ? high.y : low.y,
                                corner & 4 ? high.z : low.z);
            const glm::dvec3 from_target = at - target_;
            for (const auto &[axis, size] : {std::pair(other.right(), lens.width), {other.up(), lens.height}})
                distance_ = std::max(distance_,
                                     std::abs(glm::dot(from_target, axis)) * lens.focal_px() * 2 / (margin * size) +
                                         glm::dot(from_target, other.back()));
        }
    }
}

void Orbit::turn(double right_degrees, double up_degrees) {
    constexpr double steepest = std::numbers::pi / 2;
    azimuth_ = std::remainder(azimuth_ + glm::radians(right_degrees), 2 * std::numbers::pi);
    elevation_ = std::clamp(elevation_ + glm::radians(up_degrees), -steepest, steepest);
}

void Orbit::zoom(double factor) {
    distance_ = std::clamp(distance_ * factor, 1e-9, 1e9);
}

void Orbit::pan(double right_px, double down_px, const Lens &lens) {
    target_ += (up() * down_px - right() * right_px) * (distance_ / lens.focal_px());
}

glm::dvec3 Orbit::back() const {
    return axes_ * glm::dvec3(std::sin(azimuth_) * std::cos(elevation_), std::sin(elevation_),
                              std::cos(azimuth_) * std::cos(elevation_));
}

glm::dvec3 Orbit::right() const {
    return axes_ * glm::dvec3(std::cos(azimuth_), 0, -std::sin(azimuth_));
}

glm::dvec3 Orbit::eye() const {
    return target_ + distance_ * back();
}

arhost_camera Orbit::camera(const Lens &lens) const {
    arhost_camera camera{};
    camera.struct_size = sizeof camera;
    const glm::dvec3 eye = this->eye(), up = this->up();
    for (int i = 0; i < 3; ++i) {
        camera.eye[i] = eye[i];
        camera.look_at[i] = target_[i];
        camera.up[i] = up[i];
    }
    camera.intrinsics.struct_size = sizeof camera.intrinsics;
    camera.intrinsics.width = lens.width;
    camera.intrinsics.height = lens.height;
    camera.intrinsics.distortion = ARHOST_DISTORTION_NONE;
    camera.intrinsics.fx = camera.intrinsics.fy = lens.focal_px();
    camera.intrinsics.cx = (lens.width - 1) / 2.0;
    camera.intrinsics.cy = (lens.height - 1) / 2.0;
    return camera;
}

} // namespace arhost::view
