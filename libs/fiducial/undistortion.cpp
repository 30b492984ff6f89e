// SPDX-License-Identifier: Apache-2.0
#include "undistortion.hpp"

#include <arhost-cpp/plugin.hpp>

#include <cmath>

namespace arhost::fiducial {
namespace {

const arhost_intrinsics &checked(const arhost_intrinsics &intrinsics) {
    const auto count = intrinsics.coefficient_count;
    const bool valid =
        intrinsics.distortion == ARHOST_DISTORTION_NONE ||
        (intrinsics.distortion == ARHOST_DISTORTION_FISHEYE && count == 4) ||
        (intrinsics.distortion == ARHOST_DISTORTION_BROWN && (count == 4 || count == 5 || count == 8 || count == 12));
    if (!valid || !(intrinsics.fx > 0) || !(intrinsics.fy > 0))
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "the camera calibration is invalid: fx and fy must be greater than 0, and the distortion must "
                      "be none, brown with 4, 5, 8 or 12 coefficients, or fisheye with 4 coefficients");
    return intrinsics;
}

} // namespace

Lens::Lens(const arhost_intrinsics &intrinsics)
    : fx_(intrinsics.fx), fy_(intrinsics.fy), lens_(checked(intrinsics)) {}

std::optional<std::vector<cv::Point2d>> Lens::undistort(const std::vector<cv::Point2d> &pixels) const {
    std::vector<cv::Point2d> result;
    result.reserve(pixels.size());
    for (const cv::Point2d &pixel : pixels) {
        if (!std::isfinite(pixel.x) || !std::isfinite(pixel.y))
            return std::nullopt;
        const auto ray = lens_.ray({pixel.x, pixel.y});
        if (!ray || !(ray->z > 0))
            return std::nullopt;
        result.emplace_back(fx_ * ray->x / ray->z, fy_ * ray->y / ray->z);
    }
    return result;
}

std::optional<std::vector<cv::Point2d>> Lens::distort(const std::vector<cv::Point2d> &undistorted_px) const {
    std::vector<cv::Point2d> pixels;
    pixels.reserve(undistorted_px.size());
    for (const cv::Point2d &point : undistorted_px) {
        const auto pixel = lens_.project({point.x / fx_, point.y / fy_, 1});
        if (!pixel)
            return std::nullopt;
        pixels.emplace_back(pixel->x, pixel->y);
    }
    return pixels;
}

double noise_scale(const std::vector<cv::Point2d> &undistorted_px, const std::vector<cv::Point2d> &distorted_px) {
    const auto perimeter_px = [](const std::vector<cv::Point2d> &square) {
        double sum = 0;
        for (std::size_t i = 0; i < square.size(); ++i)
            sum += cv::norm(square[(i + 1) % square.size()] - square[i]);
        return sum;
    };
    return perimeter_px(distorted_px) / perimeter_px(undistorted_px);
}

} // namespace arhost::fiducial
