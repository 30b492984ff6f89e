// SPDX-License-Identifier: Apache-2.0
#include "calibrate/calibration.hpp"

#include "base/text.hpp"

#include <fmt/format.h>
#include <opencv2/calib3d.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <stdexcept>

namespace arhost::calibrate {
namespace {

constexpr double degrees = 180 / std::numbers::pi;

Tilt tilt_of(const cv::Vec3d &rotation) {
    cv::Matx33d camera_from_board;
    cv::Rodrigues(rotation, camera_from_board);
    const cv::Matx31d away = camera_from_board.col(2); // the board's z axis points away from the camera
    return {std::atan2(away(0), away(2)) * degrees, std::atan2(away(1), away(2)) * degrees};
}

struct Solution {
    Lens lens;
    std::array<double, 4> deviations_px;
    std::vector<cv::Vec3d> rotations, translations;
};

// Projects the board. `by_lens` and `by_pose` receive the derivatives with respect to fx, fy, cx, cy and the
// coefficients, and with respect to rotation and translation.
std::vector<cv::Point2d> project(const View &view, const Lens &lens, const cv::Vec3d &rotation,
                                 const cv::Vec3d &translation, cv::Mat *by_lens = nullptr,
                                 cv::Mat *by_pose = nullptr) {
    const std::vector<cv::Point3d> board(view.board_mm.begin(), view.board_mm.end());
    std::vector<cv::Point2d> pixels;
    cv::Mat jacobian;
    const int coefficients = static_cast<int>(lens.coefficients.size());
    if (lens.model == Model::fisheye) {
        cv::fisheye::projectPoints(board, pixels, rotation, translation, lens.matrix, lens.coefficients, 0, jacobian);
        if (by_lens)
            *by_lens = jacobian.colRange(0, 4 + coefficients);
        if (by_pose)
            *by_pose = jacobian.colRange(4 + coefficients, 10 + coefficients);
    } else {
        cv::projectPoints(board, rotation, translation, lens.matrix, lens.coefficients, pixels, jacobian);
        if (by_lens)
            *by_lens = jacobian.colRange(6, 10 + coefficients);
        if (by_pose)
            *by_pose = jacobian.colRange(0, 6);
    }
    return pixels;
}

std::vector<double> residuals_px(const View &view, const Solution &solution, std::size_t i) {
    const std::vector<cv::Point2d> pixels =
        project(view, solution.lens, solution.rotations[i], solution.translations[i]);
    std::vector<double> residuals(pixels.size());
    std::ranges::transform(pixels, view.image_px, residuals.begin(),
                           [](const auto &a, const auto &b) { return cv::norm(a - cv::Point2d(b)); });
    return residuals;
}

double median(std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::ranges::nth_element(values, middle);
    return *middle;
}

double rms(const std::vector<double> &values) {
    return std::sqrt(std::inner_product(values.begin(), values.end(), values.begin(), 0.0) /
                     static_cast<double>(values.size()));
}

// Standard deviations of fx, fy, cx, cy, computed from the inverse of the normal equations and the residuals. Those
// of OpenCV's calibrateCamera are too large by √2, because it divides by the number of corners instead of
// coordinates. OpenCV's fisheye::calibrate returns the uncertainties of one iteration's step.
std::array<double, 4> deviations_px(const std::vector<View> &views, const Solution &solution) {
    const int lens_parameters = 4 + static_cast<int>(solution.lens.coefficients.size()), pose_parameters = 6;
    const int count = lens_parameters + pose_parameters * static_cast<int>(views.size());
    cv::Mat_<double> normal = cv::Mat_<double>::zeros(count, count);
    double squares = 0;
    int equations = 0;
    for (std::size_t i = 0; i < views.size(); ++i) {
        cv::Mat by_lens, by_pose;
        project(views[i], solution.lens, solution.rotations[i], solution.translations[i], &by_lens, &by_pose);
        const cv::Range lens(0, lens_parameters);
        const int begin = lens_parameters + pose_parameters * static_cast<int>(i);
        const cv::Range pose(begin, begin + pose_parameters);
        normal(lens, lens) += by_lens.t() * by_lens;
        normal(pose, pose) += by_pose.t() * by_pose;
        normal(lens, pose) += by_lens.t() * by_pose;
        normal(pose, lens) += by_pose.t() * by_lens;
        for (const double residual : residuals_px(views[i], solution, i))
            squares += residual * residual;
        equations += by_lens.rows;
    }
    const cv::Mat inverse = normal.inv(cv::DECOMP_SVD);
    const double variance = squares / std::max(equations - count, 1);
    std::array<double, 4> deviations{};
    for (int k = 0; k < 4; ++k)
        deviations[static_cast<std::size_t>(k)] = std::sqrt(std::abs(inverse.at<double>(k, k)) * variance);
    return deviations;
}

Solution solve(const std::vector<View> &views, const cv::Size &image, Model model) {
    std::vector<std::vector<cv::Point3f>> board_mm(views.size());
    std::vector<std::vector<cv::Point2f>> image_px(views.size());
    std::ranges::transform(views, board_mm.begin(), &View::board_mm);
    std::ranges::transform(views, image_px.begin(), &View::image_px);
    const cv::TermCriteria criteria(cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 200, 1e-10);
    // fisheye::calibrate starts with a given focal length, by default that of 180 degrees. If the start is far from
    // the real focal length, it fails or finds a local minimum. calibrateCamera computes the first focal length from
    // the views.
    std::vector<double> first_focal_lengths{0};
    if (model == Model::fisheye)
        first_focal_lengths = {0.32, 0.5, 0.8}; // relative to the larger side of the image
    Solution best;
    double lowest_error_px = INFINITY;
    std::string problem = "the views do not determine it";
    for (const double first : first_focal_lengths) {
        Solution solution;
        solution.lens.model = model;
        cv::Matx33d &matrix = solution.lens.matrix;
        cv::Mat coefficients;
        double error_px = INFINITY;
        try {
            if (model == Model::fisheye) {
                const double focal_length = first * std::max(image.width, image.height);
                matrix = {
                    focal_length, 0, (image.width - 1) / 2.0, 0, focal_length, (image.height - 1) / 2.0, 0, 0, 1};
                coefficients = cv::Mat::zeros(4, 1, CV_64F);
                error_px = cv::fisheye::calibrate(
                    board_mm, image_px, image, matrix, coefficients, solution.rotations, solution.translations,
                    cv::fisheye::CALIB_RECOMPUTE_EXTRINSIC | cv::fisheye::CALIB_FIX_SKEW |
                        cv::fisheye::CALIB_USE_INTRINSIC_GUESS,
                    criteria);
                matrix(0, 1) = 0;
            } else {
                error_px = cv::calibrateCamera(board_mm, image_px, image, matrix, coefficients, solution.rotations,
                                               solution.translations, 0, criteria);
            }
        } catch (const cv::Exception &error) {
            problem = error.err;
            continue;
        }
        coefficients.reshape(1, 1).convertTo(coefficients, CV_64F);
        solution.lens.coefficients.assign(coefficients.begin<double>(), coefficients.end<double>());
        if (error_px < lowest_error_px && cv::checkRange(matrix) && cv::checkRange(coefficients) &&
            std::min(matrix(0, 0), matrix(1, 1)) > 0) {
            lowest_error_px = error_px;
            best = solution;
        }
    }
    if (!std::isfinite(lowest_error_px))
        throw std::runtime_error(fmt::format("OpenCV finds no lens that fits the views ({}); check the board's "
                                             "description, and take more views with different tilts",
                                             problem));
    best.deviations_px = deviations_px(views, best);
    return best;
}

// Removes corners with errors far above those of the others: ChArUco's detector sometimes reports the corner of a
// marker instead. Returns whether there were any. If a view has many such corners, the whole view is wrong; it is not
// changed.
bool leave_out_corners(std::vector<View> &views, const std::vector<std::vector<double>> &residuals) {
    std::vector<double> all;
    for (const std::vector<double> &of_view : residuals)
        all.insert(all.end(), of_view.begin(), of_view.end());
    const double limit_px = 6 * median(all) + 0.2;
    bool have_changed = false;
    for (std::size_t i = 0; i < views.size(); ++i) {
        const auto wrong = std::ranges::count_if(residuals[i], [&](double residual) { return residual > limit_px; });
        if (wrong == 0 || static_cast<std::size_t>(wrong) > residuals[i].size() / 8)
            continue;
        View kept{views[i].name, {}, {}};
        for (std::size_t k = 0; k < residuals[i].size(); ++k)
            if (residuals[i][k] <= limit_px) {
                kept.board_mm.push_back(views[i].board_mm[k]);
                kept.image_px.push_back(views[i].image_px[k]);
            }
        views[i] = kept;
        have_changed = true;
    }
    return have_changed;
}

} // namespace

Tilt tilt_of(const View &view, const Lens &lens) {
    std::vector<cv::Point2f> rays;
    if (lens.model == Model::fisheye)
        cv::fisheye::undistortPoints(view.image_px, rays, lens.matrix, lens.coefficients);
    else
        cv::undistortPoints(view.image_px, rays, lens.matrix, lens.coefficients);
    cv::Vec3d rotation, translation;
    if (!cv::solvePnP(view.board_mm, rays, cv::Matx33d::eye(), cv::noArray(), rotation, translation, false,
                      cv::SOLVEPNP_IPPE))
        return {};
    return tilt_of(rotation);
}

Lens assumed_lens(const cv::Size &image) {
    const double focal_length = std::max(image.width, image.height);
    return {Model::brown,
            {focal_length, 0, (image.width - 1) / 2.0, 0, focal_length, (image.height - 1) / 2.0, 0, 0, 1},
            {}};
}

Calibration calibrate(std::span<const View> views, const cv::Size &image, Model model) {
    if (views.size() < fewest_views)
        throw std::runtime_error(
            fmt::format("the board was found in {}, but a calibration needs at least {}, and a good one 10",
                        base::count_of(views.size(), "view"), fewest_views));
    Calibration calibration{image, {}, {}, 0, {}, {}};
    std::vector<std::size_t> indices(views.size());
    std::iota(indices.begin(), indices.end(), std::size_t{0});
    std::vector<View> chosen(views.begin(), views.end());
    for (;;) {
        const Solution solution = solve(chosen, image, model);
        std::vector<std::vector<double>> residuals(chosen.size());
        for (std::size_t i = 0; i < chosen.size(); ++i)
            residuals[i] = residuals_px(chosen[i], solution, i);
        if (leave_out_corners(chosen, residuals))
            continue;
        std::vector<double> errors(chosen.size());
        std::ranges::transform(residuals, errors.begin(), rms);
        // A wrong view increases the errors of all other views, so only the worst view is removed at a time.
        const auto worst = std::ranges::max_element(errors) - errors.begin();
        const double worst_px = errors[static_cast<std::size_t>(worst)];
        if (worst_px > 3 * median(errors) + 0.1 && indices.size() > fewest_views &&
            calibration.dropped.size() < views.size() / 4) {
            calibration.dropped.push_back({indices[static_cast<std::size_t>(worst)], worst_px});
            indices.erase(indices.begin() + worst);
            chosen.erase(chosen.begin() + worst);
            continue;
        }
        calibration.lens = solution.lens;
        calibration.deviations_px = solution.deviations_px;
        std::vector<double> all;
        for (std::size_t i = 0; i < chosen.size(); ++i) {
            all.insert(all.end(), residuals[i].begin(), residuals[i].end());
            calibration.used.push_back({indices[i], errors[i], tilt_of(solution.rotations[i]), chosen[i].image_px,
                                        residuals[i], views[indices[i]].image_px.size() - residuals[i].size()});
        }
        calibration.error_px = rms(all);
        return calibration;
    }
}

} // namespace arhost::calibrate
