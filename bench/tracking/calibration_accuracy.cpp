// SPDX-License-Identifier: Apache-2.0
//
// Calibrates rendered cameras whose lens is known, as `arhost calibrate` does, and from the same images with OpenCV's
// functions alone; then the camera of OpenCV's chessboard photos (Debian's opencv-doc), for which OpenCV has a
// result.
#include "camera/calibration.hpp"
#include "rendered_board.hpp"

#include <calibrate/board.hpp>

#include <opencv2/aruco/charuco.hpp>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

namespace {

using namespace arhost::calibrate;

struct Result {
    cv::Matx33d matrix;
    double error_px = 0;
    std::size_t views = 0;
};

Result arhost_result(const std::vector<cv::Mat> &images, const BoardOptions &options, Model model) {
    const Board board(options);
    std::vector<View> views;
    for (const cv::Mat &image : images)
        if (const auto view = board.find(image))
            views.push_back(*view);
    const Calibration calibration = calibrate(views, images[0].size(), model);
    return {calibration.lens.matrix, calibration.error_px, calibration.used.size()};
}

// As OpenCV's tutorials do, but with a window for cornerSubPix that is smaller than the squares of all images.
Result opencv_result(const std::vector<cv::Mat> &images, const BoardOptions &options, Model model) {
    std::vector<std::vector<cv::Point3f>> board_mm;
    std::vector<std::vector<cv::Point2f>> image_px;
    for (const cv::Mat &image : images) {
        std::vector<cv::Point3f> corners_mm;
        std::vector<cv::Point2f> corners_px;
        if (options.is_charuco) {
            const cv::Ptr<cv::aruco::Dictionary> dictionary =
                cv::aruco::getPredefinedDictionary(cv::aruco::DICT_5X5_100);
            const auto board =
                cv::aruco::CharucoBoard::create(options.columns, options.rows, static_cast<float>(options.square_mm),
                                                static_cast<float>(options.marker_mm), dictionary);
            std::vector<std::vector<cv::Point2f>> markers;
            std::vector<int> ids, corner_ids;
            cv::aruco::detectMarkers(image, dictionary, markers, ids);
            if (ids.empty() ||
                cv::aruco::interpolateCornersCharuco(markers, ids, image, board, corners_px, corner_ids) < 6)
                continue;
            for (const int id : corner_ids)
                corners_mm.push_back(board->chessboardCorners[static_cast<std::size_t>(id)]);
        } else {
            const cv::Size size(options.columns, options.rows);
            if (!cv::findChessboardCorners(image, size, corners_px))
                continue;
            const cv::TermCriteria criteria(cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 30, 0.001);
            cv::cornerSubPix(image, corners_px, {5, 5}, {-1, -1}, criteria);
            for (int row = 0; row < size.height; ++row)
                for (int column = 0; column < size.width; ++column)
                    corners_mm.emplace_back(column * options.square_mm, row * options.square_mm, 0);
        }
        board_mm.push_back(corners_mm);
        image_px.push_back(corners_px);
    }
    Result result{{}, 0, board_mm.size()};
    cv::Mat coefficients;
    std::vector<cv::Mat> rotations, translations;
    if (model == Model::fisheye)
        result.error_px = cv::fisheye::calibrate(
            board_mm, image_px, images[0].size(), result.matrix, coefficients, rotations, translations,
            cv::fisheye::CALIB_RECOMPUTE_EXTRINSIC | cv::fisheye::CALIB_FIX_SKEW);
    else
        result.error_px = cv::calibrateCamera(board_mm, image_px, images[0].size(), result.matrix, coefficients,
                                              rotations, translations);
    return result;
}

struct Errors {
    double focal_percent, principal_px; // the greater one of both axes
};

// Prints how far a result is from the truth.
Errors print(const char *name, const char *method, const Result &result, const cv::Matx33d &truth) {
    const auto greatest = [&](int i, int j, double a, double b) {
        return std::max(std::abs(result.matrix(0, i) - truth(0, i)) / a,
                        std::abs(result.matrix(1, j) - truth(1, j)) / b);
    };
    const Errors errors{100 * greatest(0, 1, truth(0, 0), truth(1, 1)), greatest(2, 2, 1, 1)};
    std::printf("%-22s %-8s %5zu %10.3f %16.3f %18.2f\n", name, method, result.views, result.error_px,
                errors.focal_percent, errors.principal_px);
    return errors;
}

// Returns OpenCV's result if OpenCV throws no exception.
std::optional<Result> try_opencv(const std::vector<cv::Mat> &images, const BoardOptions &options, Model model) {
    try {
        return opencv_result(images, options, model);
    } catch (const cv::Exception &) {
        return std::nullopt;
    }
}

} // namespace

int main() try {
    const BoardOptions charuco{true, 10, 7, 36, 28, "DICT_5X5_100", 0}, chessboard{false, 9, 6, 36, 0, "", 0};
    bool met = true;
    std::printf("%-22s %-8s %5s %10s %16s %18s\n", "images", "by", "views", "RMS, px", "focal length, %",
                "principal point, px");
    const auto compare = [&](const char *name, const std::vector<cv::Mat> &images, const BoardOptions &board,
                             Model model, const cv::Matx33d &truth) {
        const Errors errors = print(name, "arhost", arhost_result(images, board, model), truth);
        if (const auto opencv = try_opencv(images, board, model))
            print(name, "OpenCV", *opencv, truth);
        else
            std::printf("%-22s %-8s found no solution\n", name, "OpenCV");
        return errors;
    };
    for (const auto &[name, board, camera] : {std::tuple{"ChArUco, brown", charuco, brown_camera()},
                                              {"chessboard, brown", chessboard, brown_camera()},
                                              {"ChArUco, fisheye", charuco, fisheye_camera()},
                                              {"chessboard, fisheye", chessboard, fisheye_camera()}}) {
        Renderer renderer(camera, board);
        std::vector<cv::Mat> images;
        for (const Pose &pose : good_poses(board.is_charuco ? 1.05 : 1.45))
            images.push_back(renderer.image(pose));
        const Errors errors = compare(name, images, board, camera.lens.model, camera.lens.matrix);
        met = met && errors.focal_percent <= 0.2 && errors.principal_px <= 1;
    }
    const std::filesystem::path photos = "/usr/share/doc/opencv-doc/examples/data";
    std::vector<cv::Mat> images;
    for (int i = 1; i <= 14; ++i) // there is no photo 10
        if (const std::string file = photos / cv::format("left%02d.jpg", i); std::filesystem::exists(file))
            images.push_back(cv::imread(file, cv::IMREAD_GRAYSCALE));
    if (images.empty()) {
        std::printf("skipped: OpenCV's photos are not installed (opencv-doc)\n");
    } else {
        const arhost_intrinsics result = arhost::camera::read_calibration(photos / "left_intrinsics.yml");
        compare("OpenCV's photos", images, {false, 9, 6, 25, 0, "", 0}, Model::brown,
                {result.fx, 0, result.cx, 0, result.fy, result.cy, 0, 0, 1});
    }
    std::printf("errors: of rendered images from the true lens, of OpenCV's photos from the result that OpenCV "
                "publishes with them. Targets for rendered images: 0.2 %%, 1 px\n");
    return met ? 0 : 1;
} catch (const std::exception &error) {
    std::fprintf(stderr, "calibration-accuracy: %s\n", error.what());
    return 1;
}
