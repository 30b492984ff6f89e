// SPDX-License-Identifier: Apache-2.0
//
// Simulated cameras and markers.
#pragma once

#include "pose/estimate.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <numbers>
#include <ostream>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

namespace arhost::pose {

constexpr double radians = std::numbers::pi / 180;

struct LensCase {
    const char *name;
    arhost_intrinsics intrinsics;
};

inline arhost_intrinsics intrinsics_of(arhost_distortion distortion, const std::vector<double> &coefficients) {
    arhost_intrinsics intrinsics{sizeof intrinsics, 1280, 720, distortion, 900, 910, 652, 349, 0, 0, {}, {}};
    intrinsics.coefficient_count = static_cast<std::uint32_t>(coefficients.size());
    std::copy(coefficients.begin(), coefficients.end(), intrinsics.coefficients);
    return intrinsics;
}

inline const LensCase lenses[] = {
    {"None", intrinsics_of(ARHOST_DISTORTION_NONE, {})},
    {"Brown4", intrinsics_of(ARHOST_DISTORTION_BROWN, {-0.28, 0.09, 0.001, -0.0007})},
    {"Brown5", intrinsics_of(ARHOST_DISTORTION_BROWN, {0.135, -0.234, 0.0007, 0.0048, 0.02})},
    {"Brown8", intrinsics_of(ARHOST_DISTORTION_BROWN, {0.4, -0.1, 0.0005, 0.0003, 0.01, 0.5, -0.05, 0.004})},
    {"Brown12", intrinsics_of(ARHOST_DISTORTION_BROWN,
                              {0.4, -0.1, 0.0005, 0.0003, 0.01, 0.5, -0.05, 0.004, 0.001, -0.0005, 0.0008, 0.0002})},
    {"Fisheye", intrinsics_of(ARHOST_DISTORTION_FISHEYE, {0.08, -0.03, 0.012, -0.003})},
};
inline void PrintTo(const LensCase &lens, std::ostream *out) {
    *out << lens.name;
}
inline std::string name_of(const testing::TestParamInfo<LensCase> &info) {
    return info.param.name;
}

// A marker at this position (mm, camera axes) that faces the camera, turned by `roll`, then tilted about an axis of
// this direction in the image.
inline Rigid pose_at(const Eigen::Vector3d &position_mm, double tilt_degrees, double axis_degrees = 0,
                     double roll_degrees = 0) {
    const Eigen::Matrix3d facing = Eigen::Vector3d(1, -1, -1).asDiagonal();
    const Eigen::Vector3d axis(std::cos(axis_degrees * radians), std::sin(axis_degrees * radians), 0);
    return {rotation_by(tilt_degrees * radians * axis) *
                rotation_by(roll_degrees * radians * Eigen::Vector3d::UnitZ()) * facing,
            position_mm};
}

// A marker that turns, tilts and moves smoothly at distances at which a focal length of 900 px gives its side 25 to
// 75 px.
inline Rigid on_path(double seconds, double phase, double side_mm) {
    const auto wave = [&](double hertz, double offset) {
        return std::sin(2 * std::numbers::pi * hertz * seconds + offset + phase);
    };
    const double distance_mm = 900.0 * side_mm / (50 + 25 * wave(0.11, 0));
    return {rotation_by({0.9 * wave(0.31, 1), 0, 0}) * rotation_by({0, 0.9 * wave(0.23, 2), 0}) *
                pose_at({0, 0, 0}, 0, 0, 100 * wave(0.07, 3)).rotation,
            {0.3 * distance_mm * wave(0.13, 4), 0.2 * distance_mm * wave(0.17, 5), distance_mm}};
}

inline std::array<Eigen::Vector3d, 4> square_at(const Rigid &target_from_marker, double side_mm) {
    std::array<Eigen::Vector3d, 4> corners = square_corners_mm(side_mm);
    for (Eigen::Vector3d &corner : corners)
        corner = target_from_marker * corner;
    return corners;
}

class Camera {
public:
    explicit Camera(const arhost_intrinsics &intrinsics, std::uint32_t seed = 1)
        : projection_(intrinsics), random_(seed) {}

    const Projection &projection() const { return projection_; }

    ObservedMarker observe(const Rigid &camera_from_target, const std::array<Eigen::Vector3d, 4> &corners_mm,
                           double noise_px = 0) {
        ObservedMarker marker{corners_mm, {}, noise_px > 0 ? noise_px : 0.1};
        for (int i = 0; i < 4; ++i) {
            const auto pixel = projection_.pixel(camera_from_target * corners_mm[i]);
            if (!pixel)
                throw std::runtime_error("the corner is not visible");
            marker.corners_px[i] = *pixel + noise_px * normal2();
        }
        return marker;
    }

    double normal() { return normal_(random_); }
    Eigen::Vector2d normal2() {
        const double x = normal();
        return {x, normal()};
    }
    double between(double low, double high) { return std::uniform_real_distribution(low, high)(random_); }

private:
    Projection projection_;
    std::mt19937 random_;
    std::normal_distribution<double> normal_;
};

inline double degrees_between(const Rigid &a, const Rigid &b) {
    return angle_between_rad(a.rotation, b.rotation) / radians;
}

} // namespace arhost::pose
