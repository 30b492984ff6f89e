// SPDX-License-Identifier: Apache-2.0
#include "picture.hpp"

#include <arhost-cpp/plugin.hpp>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tracker_image {
namespace {

constexpr int stored_side_px = 640; // of the longer side; larger pictures are reduced
constexpr int max_features = 1500;
constexpr std::size_t max_points = 200, min_points = 24;
constexpr std::size_t min_inliers = 12;
constexpr double min_inlier_share = 0.25; // of an aligned picture: three quarters may be covered
constexpr double match_ratio = 0.8;       // Lowe: distance of the best match to that of the second best
constexpr double find_tolerance_px = 4, align_tolerance_px = 1.5;

cv::Ptr<cv::ORB> detector() {
    return cv::ORB::create(max_features, 1.2F, 8, 31, 0, 2, cv::ORB::HARRIS_SCORE, 31, 12);
}

cv::Point2d transformed(const cv::Matx33d &m, cv::Point2d p) {
    const cv::Vec3d h = m * cv::Vec3d(p.x, p.y, 1);
    return {h[0] / h[2], h[1] / h[2]};
}

// Whether the transform shows the front of the picture, without a horizon through it.
bool is_plausible(const cv::Matx33d &m, const std::vector<cv::Point2f> &corners) {
    std::vector<cv::Point2d> at;
    for (const cv::Point2f &corner : corners) {
        if (!((m * cv::Vec3d(corner.x, corner.y, 1))[2] > 1e-9))
            return false;
        at.push_back(transformed(m, corner));
    }
    constexpr double min_sine = 0.05, min_side_px = 16;
    for (std::size_t i = 0; i < 4; ++i) {
        const cv::Point2d a = at[(i + 1) % 4] - at[i], b = at[(i + 2) % 4] - at[(i + 1) % 4];
        if (!(a.cross(b) > min_sine * cv::norm(a) * cv::norm(b)) || cv::norm(a) < min_side_px)
            return false;
    }
    return true;
}

// Returns the picture with the local mean removed and the local contrast made equal, so that a homogeneous change of
// the light, a gradient of it, or something that covers a part of the picture changes little elsewhere.
cv::Mat normalized(const cv::Mat &grey) {
    constexpr int window_px = 21;
    constexpr float min_deviation = 6, mean = 128, deviation = 50; // grey levels; noise is not amplified to texture
    cv::Mat values, local_mean, variance;
    grey.convertTo(values, CV_32F);
    cv::boxFilter(values, local_mean, CV_32F, {window_px, window_px});
    values -= local_mean;
    cv::boxFilter(values.mul(values), variance, CV_32F, {window_px, window_px});
    cv::sqrt(variance, variance);
    cv::Mat result;
    cv::Mat(values / (variance + min_deviation)).convertTo(result, CV_8U, deviation, mean);
    return result;
}

} // namespace

Features features_of(const cv::Mat &grey) {
    constexpr int min_side_px = 64; // ORB's pyramid and margins need as much
    Features features;
    if (std::min(grey.cols, grey.rows) < min_side_px)
        return features;
    detector()->detectAndCompute(grey, cv::noArray(), features.points, features.descriptors);
    return features;
}

Picture::Picture(const std::string &file) {
    const auto reject = [&](const std::string &reason) {
        throw arhost::Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "'" + file + "' " + reason);
    };
    cv::Mat grey = cv::imread(file, cv::IMREAD_GRAYSCALE);
    if (grey.empty())
        reject("is not an image that OpenCV can read");
    aspect_ = static_cast<double>(grey.rows) / grey.cols;
    constexpr double max_aspect = 20;
    if (!(aspect_ <= max_aspect && aspect_ >= 1 / max_aspect))
        reject("is more than " + std::to_string(static_cast<int>(max_aspect)) + " times as long as wide");
    const auto longer_side = [&] { return static_cast<double>(std::max(grey.cols, grey.rows)); };
    if (longer_side() > stored_side_px)
        cv::resize(grey, grey, {}, stored_side_px / longer_side(), stored_side_px / longer_side(), cv::INTER_AREA);
    features_ = features_of(grey);
    while (true) {
        Level level{grey.clone(), {}};
        cv::goodFeaturesToTrack(grey, level.points, max_points, 0.01, 8);
        if (!levels_.empty() && level.points.size() < min_points)
            break;
        levels_.push_back(std::move(level));
        cv::resize(grey, grey, {}, std::numbers::sqrt2 / 2, std::numbers::sqrt2 / 2, cv::INTER_AREA);
    }
    if (levels_[0].points.size() < min_points || features_.points.size() < 2 * min_inliers)
        reject("has too little texture to be recognised: it has " + std::to_string(levels_[0].points.size()) +
               " corners and " + std::to_string(features_.points.size()) + " features; " +
               std::to_string(min_points) + " and " + std::to_string(2 * min_inliers) +
               " are needed; use a picture with more details, or a larger scan of it");
}

// Returns the smallest level that is not smaller than the picture in the frame.
const Picture::Level &Picture::level_for(double area_px) const {
    std::size_t level = 0;
    while (level + 1 < levels_.size() && static_cast<double>(levels_[level + 1].grey.total()) >= area_px)
        ++level;
    return levels_[level];
}

std::vector<cv::Point2f> Picture::own_corners() const {
    const float right = static_cast<float>(levels_[0].grey.cols) - 0.5F,
                bottom = static_cast<float>(levels_[0].grey.rows) - 0.5F;
    return {{-0.5F, -0.5F}, {right, -0.5F}, {right, bottom}, {-0.5F, bottom}};
}

std::vector<cv::Point2d> Picture::corners_px(const Place &place) const {
    std::vector<cv::Point2d> corners;
    for (const cv::Point2f &corner : own_corners())
        corners.push_back(transformed(place.frame_from_picture, corner));
    return corners;
}

std::optional<Picture::Place> Picture::find(const cv::Mat &frame, const Features &features) const {
    if (features.points.size() < 2)
        return std::nullopt;
    std::vector<std::vector<cv::DMatch>> matches;
    cv::BFMatcher(cv::NORM_HAMMING).knnMatch(features_.descriptors, features.descriptors, matches, 2);
    std::vector<cv::Point2f> from, to;
    for (const auto &match : matches)
        if (match.size() == 2 && match[0].distance < match_ratio * match[1].distance) {
            from.push_back(features_.points[static_cast<std::size_t>(match[0].queryIdx)].pt);
            to.push_back(features.points[static_cast<std::size_t>(match[0].trainIdx)].pt);
        }
    if (from.size() < min_inliers)
        return std::nullopt;
    cv::Mat is_inlier;
    const cv::Mat homography = cv::findHomography(from, to, cv::RANSAC, find_tolerance_px, is_inlier);
    if (homography.empty() || static_cast<std::size_t>(cv::countNonZero(is_inlier)) < min_inliers)
        return std::nullopt;
    return align(frame, cv::Matx33d(homography));
}

std::optional<Picture::Place> Picture::align(const cv::Mat &frame, const std::vector<cv::Point2f> &corners_px) const {
    return align(frame, cv::Matx33d(cv::getPerspectiveTransform(own_corners(), corners_px)));
}

// Draws the picture as it should look in the frame, and measures with the method of Lucas and Kanade where its points
// really are.
std::optional<Picture::Place> Picture::align(const cv::Mat &frame, const cv::Matx33d &frame_from_picture) const {
    constexpr int repetitions = 2, window_px = 15, levels = 2, margin_px = 24;
    Place place{frame_from_picture, 0, 0};
    const std::vector<cv::Point2f> corners = own_corners();
    for (int repetition = 0; repetition < repetitions; ++repetition) {
        if (!is_plausible(place.frame_from_picture, corners))
            return std::nullopt;
        std::vector<cv::Point2f> outline;
        outline.reserve(corners.size());
        for (const cv::Point2f &corner : corners)
            outline.emplace_back(transformed(place.frame_from_picture, corner));
        const cv::Rect whole({0, 0}, frame.size());
        cv::Rect region = cv::boundingRect(outline);
        region = (region + cv::Point(-margin_px, -margin_px) + cv::Size(2 * margin_px, 2 * margin_px)) & whole;
        if (region.width < 2 * window_px || region.height < 2 * window_px)
            return std::nullopt;
        const Level &level = level_for(cv::contourArea(outline));
        const double x_scale = static_cast<double>(levels_[0].grey.cols) / level.grey.cols,
                     y_scale = static_cast<double>(levels_[0].grey.rows) / level.grey.rows;
        const cv::Matx33d picture_from_level(x_scale, 0, (x_scale - 1) / 2, 0, y_scale, (y_scale - 1) / 2, 0, 0, 1),
            region_from_level = cv::Matx33d(1, 0, -region.x, 0, 1, -region.y, 0, 0, 1) * place.frame_from_picture *
                                picture_from_level;
        cv::Mat drawn;
        cv::warpPerspective(level.grey, drawn, region_from_level, region.size(), cv::INTER_LINEAR,
                            cv::BORDER_REPLICATE);
        std::vector<cv::Point2f> on_picture, expected, actual;
        for (const cv::Point2f &point : level.points)
            if (const cv::Point2d at = transformed(region_from_level, point);
                cv::Rect2d(0, 0, region.width, region.height).contains(at)) {
                on_picture.emplace_back(transformed(picture_from_level, point));
                expected.emplace_back(at);
            }
        if (expected.size() < min_inliers)
            return std::nullopt;
        std::vector<std::uint8_t> is_found;
        cv::calcOpticalFlowPyrLK(normalized(drawn), normalized(frame(region)), expected, actual, is_found,
                                 cv::noArray(), {window_px, window_px}, levels);
        std::vector<cv::Point2f> from, to;
        for (std::size_t i = 0; i < is_found.size(); ++i)
            if (is_found[i]) {
                from.push_back(on_picture[i]);
                to.push_back(actual[i] + cv::Point2f(region.tl()));
            }
        if (from.size() < min_inliers)
            return std::nullopt;
        cv::Mat is_inlier;
        const cv::Mat homography = cv::findHomography(from, to, cv::RANSAC, align_tolerance_px, is_inlier);
        if (homography.empty())
            return std::nullopt;
        place.frame_from_picture = cv::Matx33d(homography);
        place.inliers = static_cast<std::size_t>(cv::countNonZero(is_inlier));
        place.inlier_share = static_cast<double>(place.inliers) / static_cast<double>(expected.size());
        if (place.inliers < min_inliers || place.inlier_share < min_inlier_share)
            return std::nullopt;
    }
    return is_plausible(place.frame_from_picture, corners) ? std::optional(place) : std::nullopt;
}

} // namespace tracker_image
