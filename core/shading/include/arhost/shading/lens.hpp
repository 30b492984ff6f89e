// SPDX-License-Identifier: Apache-2.0
//
// arhost/shading/lens.hpp: converts rays to pixels and pixels to rays for the lens models of arhost/camera.h, in
// double precision. Use it for tables and for a few points per frame: ray() iterates, so it is too slow for every
// pixel.
//
// Axes: x right, y down, z forward (OpenCV). The image plane is z = 1.
#pragma once

#include <arhost/camera.h>

#include "scalar.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>

namespace arhost::shading {

struct Point2 {
    double x, y;
};

// Returns the distortion coefficients for leaf/lens.h; coefficients beyond coefficient_count are 0.
inline std::array<double, ARHOST_MAX_DISTORTION> coefficients_of(const arhost_intrinsics &intrinsics) {
    std::array<double, ARHOST_MAX_DISTORTION> k{};
    std::copy_n(intrinsics.coefficients, std::min<std::size_t>(intrinsics.coefficient_count, k.size()), k.begin());
    return k;
}
inline BrownConrady brown_conrady_of(const arhost_intrinsics &intrinsics) {
    const auto [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y] = coefficients_of(intrinsics);
    return {k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4};
}
inline KannalaBrandt kannala_brandt_of(const arhost_intrinsics &intrinsics) {
    const auto k = coefficients_of(intrinsics);
    return {k[0], k[1], k[2], k[3]};
}

class Lens {
public:
    explicit Lens(const arhost_intrinsics &intrinsics)
        : intrinsics_(intrinsics), brown_(brown_conrady_of(intrinsics)), fisheye_(kannala_brandt_of(intrinsics)),
          limit_(monotonic_limit()) {}

    // Returns the image point (x'', y'') of a direction. Returns nullopt behind the camera (except for fisheye
    // lenses) and beyond the angle at which the distortion polynomial stops increasing, because image points would
    // fold back inwards.
    std::optional<Point2> distort(Vec3T<double> d) const {
        if (intrinsics_.distortion == ARHOST_DISTORTION_FISHEYE) {
            if (std::atan2(std::hypot(d.x, d.y), d.z) > limit_)
                return {};
            const Vec3 p = kannala_brandt(fisheye_, d);
            return Point2{p.x, p.y};
        }
        if (d.z <= 0)
            return {};
        const Point2 p{d.x / d.z, d.y / d.z};
        if (std::hypot(p.x, p.y) > limit_)
            return {};
        return brown(p);
    }

    std::optional<Point2> project(Vec3T<double> direction) const {
        const auto p = distort(direction);
        if (!p)
            return {};
        return Point2{intrinsics_.fx * p->x + intrinsics_.cx, intrinsics_.fy * p->y + intrinsics_.cy};
    }

    // Returns the direction seen at a pixel, accurate to 1e-9. The direction has z = 1, or unit length for a fisheye
    // lens. Returns nullopt if no direction maps to the pixel.
    std::optional<Vec3T<double>> ray(Point2 pixel) const {
        const Point2 p{(pixel.x - intrinsics_.cx) / intrinsics_.fx, (pixel.y - intrinsics_.cy) / intrinsics_.fy};
        switch (intrinsics_.distortion) {
        case ARHOST_DISTORTION_NONE:
            return Vec3T<double>{p.x, p.y, 1};
        case ARHOST_DISTORTION_BROWN:
            return undistort_brown(p);
        default:
            return undistort_fisheye(p);
        }
    }

private:
    static constexpr double tolerance = 1e-11; // maximum error of x'', y''
    static constexpr int max_steps = 100;

    Point2 brown(Point2 p) const {
        const Vec3 q = brown_conrady(brown_, {p.x, p.y, 1});
        return {q.x, q.y};
    }

    // Returns the undistorted radius (Brown) or the angle (fisheye) up to which the distorted radius increases:
    // beyond it, two directions would map to the same pixel. The search step of 0.001 is far finer than the features
    // of any distortion curve.
    double monotonic_limit() const {
        if (intrinsics_.distortion == ARHOST_DISTORTION_NONE)
            return 1e30;
        const bool is_fisheye = intrinsics_.distortion == ARHOST_DISTORTION_FISHEYE;
        const double end = is_fisheye ? std::numbers::pi : 20, step = 0.001;
        double before = 0;
        for (double r = step; r < end; r += step) {
            const double after =
                is_fisheye ? kannala_brandt_radius(fisheye_, r) : r * brown_conrady_radial(brown_, r * r);
            if (!(after > before))
                return r - step;
            before = after;
        }
        return end;
    }

    // Newton's method with a central-difference 2×2 Jacobian, halving steps that do not reduce the error.
    std::optional<Vec3T<double>> undistort_brown(Point2 target) const {
        const auto error_at = [&](Point2 p) {
            const Point2 q = brown(p);
            return Point2{q.x - target.x, q.y - target.y};
        };
        // std::hypot takes several times as long.
        const auto size = [](Point2 p) { return std::sqrt(p.x * p.x + p.y * p.y); };
        // Start within the limit, in the direction of the target.
        const double start = std::min(1.0, 0.9 * limit_ / std::max(size(target), 1e-30));
        Point2 p{target.x * start, target.y * start};
        Point2 error = error_at(p);
        for (int step = 0; step < max_steps && !(size(error) < tolerance); ++step) {
            constexpr double h = 1e-6;
            const Point2 right = brown({p.x + h, p.y}), left = brown({p.x - h, p.y});
            const Point2 below = brown({p.x, p.y + h}), above = brown({p.x, p.y - h});
            const double a = (right.x - left.x) / (2 * h), b = (below.x - above.x) / (2 * h);
            const double c = (right.y - left.y) / (2 * h), d = (below.y - above.y) / (2 * h);
            const double determinant = a * d - b * c;
            if (!(std::abs(determinant) > 1e-12))
                return {};
            const Point2 move{(d * error.x - b * error.y) / determinant, (a * error.y - c * error.x) / determinant};
            bool better = false;
            for (double scale = 1; scale > 1e-4 && !better; scale /= 2) {
                const Point2 next{p.x - scale * move.x, p.y - scale * move.y};
                const Point2 next_error = error_at(next);
                // Beyond limit_ there may be another solution, but it is not physical.
                if (size(next) <= limit_ && size(next_error) < size(error)) {
                    p = next;
                    error = next_error;
                    better = true;
                }
            }
            if (!better)
                break;
        }
        if (!(size(error) < 1e-10))
            return {};
        return Vec3T<double>{p.x, p.y, 1};
    }

    // Newton's method with bracketing. It always converges, because the distorted radius increases up to limit_.
    std::optional<Vec3T<double>> undistort_fisheye(Point2 target) const {
        const double r = std::hypot(target.x, target.y);
        double low = 0, high = limit_;
        if (!(r <= kannala_brandt_radius(fisheye_, high)))
            return {};
        double theta = std::min(r, high);
        for (int step = 0; step < max_steps; ++step) {
            const double error = kannala_brandt_radius(fisheye_, theta) - r;
            if (std::abs(error) < tolerance)
                break;
            (error < 0 ? low : high) = theta;
            theta -= error / kannala_brandt_slope(fisheye_, theta);
            if (!(theta > low && theta < high))
                theta = (low + high) / 2;
        }
        const double scale = r > 0 ? std::sin(theta) / r : 0;
        return Vec3T<double>{target.x * scale, target.y * scale, std::cos(theta)};
    }

    arhost_intrinsics intrinsics_;
    BrownConrady brown_;
    KannalaBrandt fisheye_;
    double limit_;
};

} // namespace arhost::shading
