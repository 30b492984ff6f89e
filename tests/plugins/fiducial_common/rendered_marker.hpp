// SPDX-License-Identifier: Apache-2.0
//
// Renders printed markers at known poses. Each pixel is the mean of several rays and is not resampled, so that edges
// are exactly at their projections.
#pragma once

#include "tracker_support.hpp"

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include <cmath>
#include <numbers>
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

// A marker's pose in the convention of arhost_marker.mt: in OpenGL eye space, column-major, in mm.
using Mt = std::array<double, 16>;

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

struct Placed {
    Print print;
    double side_mm;
    Mt mt;
};

// Renders markers with grey values of 220 for paper, 30 for ink and 140 for the background. The camera must have no
// lens distortion.
inline cv::Mat render(const arhost_intrinsics &camera, const std::vector<Placed> &markers, int rays_per_side = 6) {
    std::vector<cv::Matx33d> marker_from_pixel;
    for (const Placed &placed : markers) {
        const Mt &m = placed.mt;
        const cv::Matx33d eye_from_marker(m[0], m[4], m[12], -m[1], -m[5], -m[13], -m[2], -m[6], -m[14]);
        const cv::Matx33d pixel_from_eye(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
        marker_from_pixel.push_back((pixel_from_eye * eye_from_marker).inv());
    }
    const auto grey_at = [&](double u, double v) {
        for (std::size_t i = 0; i < markers.size(); ++i) {
            const Print &print = markers[i].print;
            const cv::Vec3d at = marker_from_pixel[i] * cv::Vec3d(u, v, 1);
            if (at[2] <= 0)
                continue;
            const double cell_mm = markers[i].side_mm / print.corner_cells, half = print.cells.cols / 2.0;
            const int column = static_cast<int>(std::floor(at[0] / at[2] / cell_mm + half));
            const int row = static_cast<int>(std::floor(half - at[1] / at[2] / cell_mm));
            if (column >= 0 && row >= 0 && column < print.cells.cols && row < print.cells.rows)
                return print.cells(row, column) ? 220 : 30;
        }
        return 140;
    };
    cv::Mat_<uint8_t> picture(static_cast<int>(camera.height), static_cast<int>(camera.width));
    const double n = rays_per_side;
    for (int y = 0; y < picture.rows; ++y)
        for (int x = 0; x < picture.cols; ++x) {
            int sum = 0;
            for (int j = 0; j < rays_per_side; ++j)
                for (int i = 0; i < rays_per_side; ++i)
                    sum += grey_at(x + (i + 0.5) / n - 0.5, y + (j + 0.5) / n - 0.5);
            picture(y, x) = static_cast<uint8_t>(std::lround(sum / (n * n)));
        }
    return picture;
}

// Adds normally distributed noise; the same seed gives the same noise.
inline void add_noise(cv::Mat &picture, double sigma, uint64_t seed) {
    cv::Mat noise(picture.size(), CV_16S);
    cv::RNG(seed).fill(noise, cv::RNG::NORMAL, 0, sigma);
    cv::add(picture, noise, picture, cv::noArray(), CV_8U);
}

} // namespace arhost::test
