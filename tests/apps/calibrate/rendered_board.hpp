// SPDX-License-Identifier: Apache-2.0
//
// Renders views of a printed board in a camera with a known lens.
#pragma once

#include "calibrate/calibration.hpp"

#include <fiducial/aruco.hpp>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <numbers>
#include <ostream>
#include <vector>

namespace arhost::calibrate {

// Where the board's centre is in the image, and how it is turned.
struct Pose {
    double x, y;                                   // of the image's width and height
    double distance;                               // relative to that at which the board is half as wide as the image
    double about_vertical, about_horizontal, roll; // degrees
};

// Views that cover the image and the tilts. At the default distance, all contain the whole board.
inline std::vector<Pose> good_poses(double distance = 1.45) {
    constexpr std::array<std::array<double, 2>, 9> tilts{
        {{30, 0}, {-30, 0}, {0, 30}, {0, -30}, {22, 22}, {-22, 22}, {22, -22}, {-22, -22}, {0, 0}}};
    std::vector<Pose> poses;
    for (std::size_t i = 0; i < 18; ++i) {
        const std::size_t place = i % 9;
        const auto &tilt = tilts[(place * 4 + i / 9 * 5) % 9];
        poses.push_back({0.25 + 0.25 * static_cast<double>(place % 3), 0.25 + 0.25 * static_cast<double>(place / 3),
                         i < 9 ? distance : 1.1 * distance, tilt[0], tilt[1], static_cast<double>(i % 5) * 4 - 8});
    }
    return poses;
}

struct TrueCamera {
    cv::Size size;
    Lens lens;
};

inline void PrintTo(const TrueCamera &camera, std::ostream *out) {
    *out << (camera.lens.model == Model::fisheye ? "fisheye" : "brown");
}

inline TrueCamera brown_camera() {
    return {{640, 480}, {Model::brown, {521, 0, 326, 0, 523, 235, 0, 0, 1}, {-0.24, 0.08, 0.0011, -0.0008, -0.01}}};
}
inline TrueCamera fisheye_camera() {
    return {{640, 480}, {Model::fisheye, {336, 0, 316, 0, 337, 245, 0, 0, 1}, {0.04, -0.012, 0.004, -0.001}}};
}

// A board as a picture, one pixel per 1/scale mm. The origin of the board is its first inner corner.
struct Print {
    cv::Mat picture;
    double scale;          // px per mm
    cv::Point2d origin_px; // outer edges of pixels are at integers
    cv::Size2d size_mm;    // between the outermost inner corners
};

inline Print print_of(const BoardOptions &board) {
    const int columns = board.columns + (board.is_charuco ? 0 : 1), rows = board.rows + (board.is_charuco ? 0 : 1);
    constexpr int scale = 2;
    const int square = static_cast<int>(board.square_mm) * scale;
    Print print{cv::Mat((rows + 2) * square, (columns + 2) * square, CV_8U, cv::Scalar(255)),
                scale,
                {2.0 * square, 2.0 * square},
                {(columns - 2) * board.square_mm, (rows - 2) * board.square_mm}};
    int id = board.first_id;
    for (int row = 0; row < rows; ++row)
        for (int column = 0; column < columns; ++column) {
            const cv::Rect at((column + 1) * square, (row + 1) * square, square, square);
            if ((row + column) % 2 == 0) {
                print.picture(at) = 0;
            } else if (board.is_charuco) {
                const auto type =
                    std::ranges::find(aruco::dictionary_types, board.dictionary, &aruco::DictionaryType::option);
                const int side = static_cast<int>(board.marker_mm) * scale, inset = (square - side) / 2;
                cv::Mat marker;
                aruco::draw(aruco::predefined(type->name), id++, side, marker, 1);
                marker.copyTo(print.picture(cv::Rect(at.x + inset, at.y + inset, side, side)));
            }
        }
    return print;
}

inline void place(const Pose &pose, const TrueCamera &camera, const cv::Size2d &board_mm, cv::Matx33d &rotation,
                  cv::Vec3d &translation) {
    const auto turn = [](double x, double y, double z) {
        cv::Matx33d matrix;
        cv::Rodrigues(cv::Vec3d(x, y, z) * (std::numbers::pi / 180), matrix);
        return matrix;
    };
    // Positive tilts as in Tilt.
    rotation = turn(0, pose.about_vertical, 0) * turn(-pose.about_horizontal, 0, 0) * turn(0, 0, pose.roll);
    std::vector<cv::Point2d> centre{{pose.x * camera.size.width, pose.y * camera.size.height}};
    if (camera.lens.model == Model::fisheye)
        cv::fisheye::undistortPoints(centre, centre, camera.lens.matrix, camera.lens.coefficients);
    else
        cv::undistortPoints(centre, centre, camera.lens.matrix, camera.lens.coefficients);
    const double distance_mm = pose.distance * camera.lens.matrix(0, 0) * board_mm.width / (camera.size.width / 2.0);
    translation = distance_mm * cv::Vec3d(centre[0].x, centre[0].y, 1) -
                  rotation * cv::Vec3d(board_mm.width / 2, board_mm.height / 2, 0);
}

// Renders with exact projection: each pixel is the mean of 9 rays through the lens.
class Renderer {
public:
    Renderer(const TrueCamera &camera, const BoardOptions &board)
        : camera_(camera), print_(print_of(board)), rays_(camera.size * supersampling, CV_32FC2), random_(7) {
        std::vector<cv::Point2d> pixels;
        for (int y = 0; y < rays_.rows; ++y)
            for (int x = 0; x < rays_.cols; ++x)
                pixels.emplace_back((x + 0.5) / supersampling - 0.5, (y + 0.5) / supersampling - 0.5);
        const cv::TermCriteria exact(cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 40, 1e-9);
        if (camera.lens.model == Model::fisheye)
            cv::fisheye::undistortPoints(pixels, pixels, camera.lens.matrix, camera.lens.coefficients);
        else
            cv::undistortPoints(pixels, pixels, camera.lens.matrix, camera.lens.coefficients, cv::noArray(),
                                cv::noArray(), exact);
        cv::Mat(pixels).reshape(2, rays_.rows).convertTo(rays_, CV_32F);
    }

    cv::Mat image(const Pose &pose, double blur_px = 0.6) {
        cv::Matx33d rotation;
        cv::Vec3d translation;
        place(pose, camera_, print_.size_mm, rotation, translation);
        // A point (x, y) of the board is at the ray H (x, y, 1).
        const cv::Matx33d rays_from_board(rotation(0, 0), rotation(0, 1), translation[0], rotation(1, 0),
                                          rotation(1, 1), translation[1], rotation(2, 0), rotation(2, 1),
                                          translation[2]);
        const cv::Matx33d picture_from_board(print_.scale, 0, print_.origin_px.x - 0.5, 0, print_.scale,
                                             print_.origin_px.y - 0.5, 0, 0, 1);
        cv::Mat positions, fine, grey;
        cv::perspectiveTransform(rays_, positions, picture_from_board * rays_from_board.inv());
        cv::remap(print_.picture, fine, positions, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_CONSTANT, 130);
        cv::resize(fine, grey, camera_.size, 0, 0, cv::INTER_AREA);
        cv::GaussianBlur(grey, grey, {}, blur_px);
        cv::Mat noisy, noise(grey.size(), CV_32F);
        random_.fill(noise, cv::RNG::NORMAL, 25, 2); // 25 to 205: neither black nor white is clipped
        cv::Mat(grey).convertTo(noisy, CV_32F, 0.7);
        noisy += noise;
        noisy.convertTo(grey, CV_8U);
        return grey;
    }

private:
    static constexpr int supersampling = 3;
    TrueCamera camera_;
    Print print_;
    cv::Mat rays_;
    cv::RNG random_;
};

} // namespace arhost::calibrate
