// SPDX-License-Identifier: Apache-2.0
#include "path.hpp"

#include <arhost/shading/vec3.hpp>

#include <cmath>
#include <numbers>

namespace arhost::synthetic {
namespace {

using Vec3d = shading::Vec3T<double>;

Vec3d normalized(Vec3d v) {
    return v * (1 / std::sqrt(dot(v, v)));
}

// A sine with a whole number of cycles per period, so that the path closes.
double wave(double phase, int cycles, double offset) {
    return std::sin(2 * std::numbers::pi * cycles * phase + offset);
}

// Hand tremor, about −1 to 1: 1 to 4 Hz at the default period of 10 s.
double tremor(double phase, double offset) {
    return 0.5 * wave(phase, 11, offset) + 0.3 * wave(phase, 19, 2.1 * offset + 1) +
           0.2 * wave(phase, 37, 3.7 * offset + 2);
}

} // namespace

Mt pose_on_path(PathKind kind, double phase, double distance_scale, double unit_mm) {
    constexpr double degree = std::numbers::pi / 180;
    double azimuth = -112, tilt = 46, distance = 480, roll = -2, hand = 1;
    switch (kind) {
    case PathKind::still:
        hand = 0;
        break;
    case PathKind::orbit:
        azimuth += 360 * phase + 8 * wave(phase, 2, 0.4);
        tilt = 44 + 11 * wave(phase, 1, 0.6) + 3 * wave(phase, 3, 2.0);
        distance = 480 + 90 * wave(phase, 1, 2.9) + 22 * wave(phase, 3, 0.5);
        roll += 4 * wave(phase, 2, 1.0) + 2 * wave(phase, 3, 0);
        break;
    case PathKind::approach: {
        const double near = 0.5 - 0.5 * wave(phase, 1, std::numbers::pi / 2);
        azimuth += 14 * near;
        tilt = 58 - 30 * near;
        distance = 680 - 320 * near;
        roll += 2 * wave(phase, 1, 0);
        break;
    }
    }
    azimuth += hand * 0.35 * tremor(phase, 0.3);
    tilt += hand * 0.30 * tremor(phase, 1.7);
    distance += hand * 1.5 * tremor(phase, 2.9);
    roll += hand * 0.35 * tremor(phase, 4.1);

    const double a = azimuth * degree, t = tilt * degree;
    const Vec3d back{std::sin(t) * std::cos(a), std::sin(t) * std::sin(a), std::cos(t)};
    // Looks slightly above the marker, where virtual objects will stand.
    Vec3d target{6 * wave(phase, 1, 1.1), 6 * wave(phase, 2, 0.2), 16};
    if (kind == PathKind::still)
        target = {0, 0, 16};
    target = target + Vec3d{tremor(phase, 5.3), tremor(phase, 0.9), 0} * (hand * 1.2);
    const Vec3d eye = target + back * (distance * distance_scale);

    const Vec3d right_level = normalized(cross({0, 0, 1}, back)), up_level = cross(back, right_level);
    const double c = std::cos(roll * degree), s = std::sin(roll * degree);
    const Vec3d right = right_level * c + up_level * s, up = up_level * c - right_level * s;
    const auto column = [&](double Vec3d::*axis) { return std::array{right.*axis, up.*axis, back.*axis}; };
    const auto x = column(&Vec3d::x), y = column(&Vec3d::y), z = column(&Vec3d::z);
    const Vec3d origin = eye * -unit_mm;
    return {x[0],
            x[1],
            x[2],
            0,
            y[0],
            y[1],
            y[2],
            0,
            z[0],
            z[1],
            z[2],
            0,
            dot(right, origin),
            dot(up, origin),
            dot(back, origin),
            1};
}

} // namespace arhost::synthetic
