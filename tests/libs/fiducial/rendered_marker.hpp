// SPDX-License-Identifier: Apache-2.0
//
// Printed markers at known poses.
#pragma once

#include "conformance/prints.hpp"
#include "solved_pose.hpp"

#include <glm/gtc/type_ptr.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>
#include <vector>

namespace arhost::test {

// A square sheet of cells: 255 is white, 0 is black, row 0 is the top row.
struct Print {
    cv::Mat_<uint8_t> cells;
    int corner_cells; // side, in cells, of the centred square whose corners a tracker reports

    // Returns the print with an additional white margin (quiet zone) of `cells_wide` cells.
    Print with_margin(int cells_wide) const {
        Print wider{{}, corner_cells};
        cv::copyMakeBorder(cells, wider.cells, cells_wide, cells_wide, cells_wide, cells_wide, cv::BORDER_CONSTANT,
                           255);
        return wider;
    }
    Print mirrored() const {
        Print other{{}, corner_cells};
        cv::flip(cells, other.cells, 1);
        return other;
    }
};

// Returns the pose of a marker whose centre is at (x, y, −distance) and that is rotated about the camera's x axis,
// then its y axis, then its z axis (in degrees). Without a rotation, the marker is upright and faces the camera.
inline Mt pose_of(double x_mm, double y_mm, double distance_mm, double about_x = 0, double about_y = 0,
                  double about_z = 0) {
    const auto rotation_about = [](int axis, double degrees) {
        cv::Vec3d rotation{};
        rotation[axis] = degrees * std::numbers::pi / 180;
        cv::Matx33d r;
        cv::Rodrigues(rotation, r);
        return r;
    };
    const cv::Matx33d r = rotation_about(2, about_z) * rotation_about(1, about_y) * rotation_about(0, about_x);
    Mt mt{};
    for (int column = 0; column < 3; ++column)
        for (int row = 0; row < 3; ++row)
            mt[column * 4 + row] = r(row, column);
    mt[12] = x_mm;
    mt[13] = y_mm;
    mt[14] = -distance_mm;
    mt[15] = 1;
    return mt;
}

// Returns the angle between the rotations of two poses.
inline double angle_degrees(const Mt &a, const Mt &b) {
    double trace = 0;
    for (int i = 0; i < 11; ++i)
        trace += i % 4 < 3 ? a[i] * b[i] : 0;
    return std::acos(std::clamp((trace - 1) / 2, -1.0, 1.0)) * 180 / std::numbers::pi;
}

// Projects a point of the marker (x to the right, y up, in mm) to a pixel, with the formulas of arhost/camera.h.
inline cv::Point2d pixel_of(const Mt &mt, const arhost_intrinsics &camera, double x_mm, double y_mm) {
    const auto eye = [&](int row) { return mt[row] * x_mm + mt[4 + row] * y_mm + mt[12 + row]; };
    const double x = eye(0) / -eye(2), y = -eye(1) / -eye(2);
    const double *k = camera.coefficients;
    double xd = x, yd = y;
    const double r2 = x * x + y * y;
    if (camera.distortion == ARHOST_DISTORTION_BROWN) {
        const double radial =
            (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
        xd = x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x) + k[8] * r2 + k[9] * r2 * r2;
        yd = y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y + k[10] * r2 + k[11] * r2 * r2;
    } else if (camera.distortion == ARHOST_DISTORTION_FISHEYE && r2 > 0) {
        const double r = std::sqrt(r2), t = std::atan(r), t2 = t * t;
        const double scale = t * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3])))) / r;
        xd = x * scale;
        yd = y * scale;
    }
    return {camera.fx * xd + camera.cx, camera.fy * yd + camera.cy};
}

// Returns the pixels of the marker's corners, in the order that arhost/tracker.h defines.
inline std::array<cv::Point2d, 4> corners_of(const Mt &mt, const arhost_intrinsics &camera, double side_mm) {
    const double h = side_mm / 2;
    return {pixel_of(mt, camera, -h, h), pixel_of(mt, camera, h, h), pixel_of(mt, camera, h, -h),
            pixel_of(mt, camera, -h, -h)};
}

// Returns the camera with so many times the resolution.
inline arhost_intrinsics enlarged(arhost_intrinsics camera, int times) {
    camera.width *= static_cast<std::uint32_t>(times);
    camera.height *= static_cast<std::uint32_t>(times);
    for (double *value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy})
        *value *= times;
    for (double *centre : {&camera.cx, &camera.cy})
        *centre += (times - 1) / 2.0; // pixel centres are at integers
    return camera;
}

// Covers a corner of a marker, and what is beside it, with one grey level. `hidden`: side of the cover inside the
// marker, relative to that of the marker. `corner`: index in corners_of().
inline void hide_corner(cv::Mat &picture, const arhost_intrinsics &camera, const Mt &mt, double side_mm,
                        double hidden, int level, int corner = 0) {
    const double far = 0.6 * side_mm, near = side_mm * (0.5 - hidden);
    const double right = corner == 1 || corner == 2 ? 1 : -1, up = corner < 2 ? 1 : -1;
    std::vector<cv::Point> cover;
    for (const auto &[x, y] : {std::pair(far, far), {near, far}, {near, near}, {far, near}})
        cover.emplace_back(pixel_of(mt, camera, right * x, up * y));
    cv::fillConvexPoly(picture, cover, cv::Scalar(level));
}

struct Placed {
    Print print;
    double side_mm;
    Mt mt;
};

// Renders markers with the conformance suite's renderer.
inline cv::Mat render(const arhost_intrinsics &camera, const std::vector<Placed> &markers) {
    std::vector<conformance::Placed> placed;
    for (const auto &[print, side_mm, mt] : markers) {
        const int side = print.cells.cols, border = (side - print.corner_cells) / 2;
        placed.push_back({{0,
                           static_cast<std::uint32_t>(side),
                           {print.cells.begin(), print.cells.end()},
                           static_cast<std::uint32_t>(border)},
                          side_mm,
                          glm::make_mat4(mt.data())});
    }
    conformance::Grey drawn = conformance::draw(camera, placed);
    return cv::Mat(static_cast<int>(drawn.height), static_cast<int>(drawn.width), CV_8U, drawn.codes.data()).clone();
}

// Renders markers at four times the resolution, blurs them and reduces the picture, because a lens blurs before the
// pixels sample: a blur of the reduced picture would keep the aliasing of sharp edges.
inline cv::Mat render_blurred(const arhost_intrinsics &camera, const std::vector<Placed> &markers, double blur_px) {
    constexpr int fine = 4;
    cv::Mat picture = render(enlarged(camera, fine), markers), reduced;
    cv::GaussianBlur(picture, picture, {}, fine * blur_px);
    cv::resize(picture, reduced, {static_cast<int>(camera.width), static_cast<int>(camera.height)}, 0, 0,
               cv::INTER_AREA);
    return reduced;
}

// Adds normally distributed noise, and saturates the result to 8 bits; the same seed gives the same noise.
inline void add_noise(cv::Mat &picture, double sigma, uint64_t seed) {
    cv::Mat noise(picture.size(), CV_16S);
    cv::RNG(seed).fill(noise, cv::RNG::NORMAL, 0, sigma);
    cv::Mat noisy; // not `picture`, whose type may differ
    cv::add(picture, noise, noisy, cv::noArray(), CV_8U);
    picture = noisy;
}

} // namespace arhost::test
