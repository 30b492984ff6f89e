// SPDX-License-Identifier: Apache-2.0
#include "path.hpp"

#include <arhost/shading/vec3.hpp>

#include <cmath>
#include <numbers>

namespace arhost::synthetic {
namespace {

using Vec3 = shading::Vec3T<double>;

Vec3 normalized(Vec3 v) {
    return v * (1 / std::sqrt(dot(v, v)));
}

// A wave with `cycles` in a period, so that the path closes.
double wave(double turn, int cycles, double phase) {
    return std::sin(2 * std::numbers::pi * cycles * turn + phase);
}

// The unsteadiness of a hand, about −1 to 1: 1 to 4 Hz at the default period of 10 s.
double tremor(double turn, double phase) {
    return 0.5 * wave(turn, 11, phase) + 0.3 * wave(turn, 19, 2.1 * phase + 1) +
           0.2 * wave(turn, 37, 3.7 * phase + 2);
}

} // namespace

Mt pose_on_path(PathKind kind, double turn, double reach, double unit_mm) {
    constexpr double degree = std::numbers::pi / 180;
    double azimuth = -112, tilt = 46, distance = 480, roll = -2, hand = 1;
    switch (kind) {
    case PathKind::still:
        hand = 0;
        break;
    case PathKind::orbit:
        azimuth += 360 * turn + 8 * wave(turn, 2, 0.4);
        tilt = 44 + 11 * wave(turn, 1, 0.6) + 3 * wave(turn, 3, 2.0);
        distance = 480 + 90 * wave(turn, 1, 2.9) + 22 * wave(turn, 3, 0.5);
        roll += 4 * wave(turn, 2, 1.0) + 2 * wave(turn, 3, 0);
        break;
    case PathKind::approach: {
        const double near = 0.5 - 0.5 * wave(turn, 1, std::numbers::pi / 2);
        azimuth += 14 * near;
        tilt = 58 - 30 * near;
        distance = 680 - 320 * near;
        roll += 2 * wave(turn, 1, 0);
        break;
    }
    }
    azimuth += hand * 0.35 * tremor(turn, 0.3);
    tilt += hand * 0.30 * tremor(turn, 1.7);
    distance += hand * 1.5 * tremor(turn, 2.9);
    roll += hand * 0.35 * tremor(turn, 4.1);

    const double a = azimuth * degree, t = tilt * degree;
    const Vec3 back{std::sin(t) * std::cos(a), std::sin(t) * std::sin(a), std::cos(t)};
    // What it looks at: the marker, and a little above it, where something virtual will stand.
    Vec3 target{6 * wave(turn, 1, 1.1), 6 * wave(turn, 2, 0.2), 16};
    if (kind == PathKind::still)
        target = {0, 0, 16};
    target = target + Vec3{tremor(turn, 5.3), tremor(turn, 0.9), 0} * (hand * 1.2);
    const Vec3 eye = target + back * (distance * reach);

    const Vec3 right_level = normalized(cross({0, 0, 1}, back)), up_level = cross(back, right_level);
    const double c = std::cos(roll * degree), s = std::sin(roll * degree);
    const Vec3 right = right_level * c + up_level * s, up = up_level * c - right_level * s;
    const auto column = [&](double Vec3::*axis) { return std::array{right.*axis, up.*axis, back.*axis}; };
    const auto x = column(&Vec3::x), y = column(&Vec3::y), z = column(&Vec3::z);
    const Vec3 origin = eye * -unit_mm;
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
