// SPDX-License-Identifier: Apache-2.0
#include "picture.hpp"

#include <arhost-cpp/plugin.hpp>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace tracker_image {
namespace {

constexpr int stored_side_px = 640; // length of the longer side; larger pictures are scaled down
constexpr int max_features = 1500;
constexpr std::size_t max_points = 200, min_points = 24;
constexpr std::size_t min_inliers = 12;
constexpr double min_inlier_share = 0.25; // minimum share of an aligned picture's points; hidden points are outliers
// Lowe's ratio: distance of the best match divided by the distance of the second-best match.
constexpr double match_ratio = 0.8;
constexpr double find_tolerance_px = 4, align_tolerance_px = 1.5;

cv::Ptr<cv::ORB> detector() {
    return cv::ORB::create(max_features, 1.2F, 8, 31, 0, 2, cv::ORB::HARRIS_SCORE, 31, 12);
}

cv::Point2d transformed(const cv::Matx33d &m, cv::Point2d p) {
    const cv::Vec3d h = m * cv::Vec3d(p.x, p.y, 1);
    return {h[0] / h[2], h[1] / h[2]};
}

// Returns whether the transform shows the front of the picture, with no horizon across it.
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

// Returns the picture without its local mean and with equal local contrast. As a result, a homogeneous change of the
// light or a gradient of the light changes the picture only slightly. An object that hides a part of the picture
// changes the rest only slightly.
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

// Returns the root mean square distance of the points from their mean.
double spread(const std::vector<cv::Point2f> &points) {
    cv::Scalar mean, deviation;
    cv::meanStdDev(points, mean, deviation);
    return std::hypot(deviation[0], deviation[1]);
}

struct Fit {
    cv::Matx33d undistorted_from_picture;
    std::size_t inliers;
};

// Fits a homography to undistorted pixels. `tolerance_px`: the tolerance of inliers, in pixels of the frame.
std::optional<Fit> fit(const Camera &camera, const std::vector<cv::Point2f> &on_picture,
                       const std::vector<cv::Point2f> &in_frame, double tolerance_px) {
    std::vector<cv::Point2f> from, pixels, to;
    for (std::size_t i = 0; i < in_frame.size(); ++i)
        if (const auto undistorted = camera.undistort(in_frame[i])) {
            from.push_back(on_picture[i]);
            pixels.push_back(in_frame[i]);
            to.emplace_back(*undistorted);
        }
    if (from.size() < min_inliers)
        return std::nullopt;
    cv::Mat is_inlier;
    const double scale = spread(to) / std::max(spread(pixels), 1.0); // large near the rim of a wide-angle lens
    const cv::Mat homography = cv::findHomography(from, to, cv::RANSAC, scale * tolerance_px, is_inlier);
    if (homography.empty())
        return std::nullopt;
    const Fit fitted{cv::Matx33d(homography), static_cast<std::size_t>(cv::countNonZero(is_inlier))};
    return fitted.inliers < min_inliers ? std::nullopt : std::optional(fitted);
}

} // namespace

Camera::Camera(const arhost_intrinsics &intrinsics) : lens_(intrinsics) {
    // Computes every eighth pixel and interpolates the others, because the distortion is smooth. The step is a power
    // of 2, so that the interpolation weights in OpenCV are exact.
    constexpr int step_px = 8;
    constexpr float nan = std::numeric_limits<float>::quiet_NaN();
    const cv::Size size(static_cast<int>(intrinsics.width), static_cast<int>(intrinsics.height));
    cv::Mat_<cv::Vec2f> grid((size.height - 1) / step_px + 2, (size.width - 1) / step_px + 2);
    for (int row = 0; row < grid.rows; ++row)
        for (int column = 0; column < grid.cols; ++column) {
            const auto point = undistort(cv::Point2d(column * step_px, row * step_px));
            grid(row, column) =
                point ? cv::Vec2f(static_cast<float>(point->x), static_cast<float>(point->y)) : cv::Vec2f(nan, nan);
        }
    const cv::Matx23d grid_from_frame(1.0 / step_px, 0, 0, 0, 1.0 / step_px, 0);
    cv::warpAffine(grid, undistorted_, grid_from_frame, size, cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                   cv::BORDER_REPLICATE);
}

std::optional<cv::Point2d> Camera::undistort(cv::Point2d pixel) const {
    const auto points = lens_.undistort({pixel});
    return points ? std::optional(points->front()) : std::nullopt;
}

std::optional<cv::Point2d> Camera::distort(cv::Point2d undistorted_px) const {
    const auto points = lens_.distort({undistorted_px});
    return points ? std::optional(points->front()) : std::nullopt;
}

Features features_of(const cv::Mat &grey) {
    constexpr int min_side_px = 64; // minimum for ORB's pyramid and margins
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

std::vector<Picture::Place> Picture::find(const cv::Mat &frame, const Camera &camera,
                                          const Features &features) const {
    std::vector<Place> places;
    if (features.points.empty())
        return places;
    const auto is_in_a_place = [&](const cv::Point2f &point) {
        return std::ranges::any_of(places, [&](const Place &place) {
            const std::vector<cv::Point2f> outline(place.corners_px.begin(), place.corners_px.end());
            return cv::pointPolygonTest(outline, point, false) >= 0;
        });
    };
    // The features of one copy are those of the frame that resemble the picture's most. If there are several copies,
    // each feature of the picture has several such features, of which none is distinctive; so each feature of the
    // frame is then matched with those of the picture.
    for (const bool from_frame : {false, true}) {
        const Features &query = from_frame ? features : features_, &train = from_frame ? features_ : features;
        std::vector<std::vector<cv::DMatch>> matches;
        cv::BFMatcher(cv::NORM_HAMMING).knnMatch(query.descriptors, train.descriptors, matches, 2);
        std::erase_if(matches, [](const auto &match) {
            return match.size() < 2 || match[0].distance >= match_ratio * match[1].distance;
        });
        for (bool is_found = true; is_found;) {
            std::vector<cv::Point2f> on_picture, in_frame;
            for (const auto &match : matches) {
                const cv::Point2f asked = query.points[static_cast<std::size_t>(match[0].queryIdx)].pt,
                                  answer = train.points[static_cast<std::size_t>(match[0].trainIdx)].pt;
                if (!is_in_a_place(from_frame ? asked : answer)) {
                    on_picture.push_back(from_frame ? answer : asked);
                    in_frame.push_back(from_frame ? asked : answer);
                }
            }
            const auto found = fit(camera, on_picture, in_frame, find_tolerance_px);
            const auto place = found ? align(frame, camera, found->undistorted_from_picture) : std::nullopt;
            is_found = place && std::ranges::none_of(places, [&](const Place &other) {
                           return cv::norm(other.corners_px[0] - place->corners_px[0]) < find_tolerance_px;
                       });
            if (is_found)
                places.push_back(*place);
        }
    }
    return places;
}

std::optional<Picture::Place> Picture::align(const cv::Mat &frame, const Camera &camera,
                                             const std::vector<cv::Point2d> &corners_px) const {
    std::vector<cv::Point2f> corners;
    for (const cv::Point2d &corner : corners_px)
        if (const auto undistorted = camera.undistort(corner))
            corners.emplace_back(*undistorted);
    if (corners.size() != 4)
        return std::nullopt;
    return align(frame, camera, cv::Matx33d(cv::getPerspectiveTransform(own_corners(), corners)));
}

// Renders the picture as it should look in the frame. Measures the actual positions of its points by the method of
// Lucas and Kanade.
std::optional<Picture::Place> Picture::align(const cv::Mat &frame, const Camera &camera,
                                             cv::Matx33d undistorted_from_picture) const {
    constexpr int repetitions = 2, window_px = 15, levels = 2, margin_px = 24;
    Place place{};
    const std::vector<cv::Point2f> corners = own_corners();
    // Returns the pixels at which the lens shows points of the picture. Omits points outside the field of view.
    const auto shown = [&](const std::vector<cv::Point2f> &points) {
        std::vector<cv::Point2d> pixels;
        for (const cv::Point2f &point : points)
            if (const auto pixel = camera.distort(transformed(undistorted_from_picture, point)))
                pixels.push_back(*pixel);
        return pixels;
    };
    std::vector<cv::Point2f> outline; // has points between the corners, because a lens bends edges
    for (std::size_t i = 0; i < 4; ++i)
        for (const float along : {0.0F, 0.25F, 0.5F, 0.75F})
            outline.push_back(corners[i] + along * (corners[(i + 1) % 4] - corners[i]));
    for (int repetition = 0; repetition < repetitions; ++repetition) {
        if (!is_plausible(undistorted_from_picture, corners))
            return std::nullopt;
        const std::vector<cv::Point2d> outline_px = shown(outline);
        const std::vector<cv::Point2f> polygon(outline_px.begin(), outline_px.end());
        if (polygon.size() < 3)
            return std::nullopt;
        const cv::Rect whole({0, 0}, frame.size());
        cv::Rect region = cv::boundingRect(polygon);
        region = (region + cv::Point(-margin_px, -margin_px) + cv::Size(2 * margin_px, 2 * margin_px)) & whole;
        if (region.width < 2 * window_px || region.height < 2 * window_px)
            return std::nullopt;
        const Level &level = level_for(cv::contourArea(polygon));
        const double x_scale = static_cast<double>(levels_[0].grey.cols) / level.grey.cols,
                     y_scale = static_cast<double>(levels_[0].grey.rows) / level.grey.rows;
        const cv::Matx33d picture_from_level(x_scale, 0, (x_scale - 1) / 2, 0, y_scale, (y_scale - 1) / 2, 0, 0, 1);
        cv::Mat in_level, drawn;
        cv::perspectiveTransform(camera.undistorted(region), in_level,
                                 (undistorted_from_picture * picture_from_level).inv());
        cv::remap(level.grey, drawn, in_level, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
        std::vector<cv::Point2f> on_picture, expected, actual;
        for (const cv::Point2f &point : level.points) {
            const cv::Point2d on_largest = transformed(picture_from_level, point);
            const auto at = camera.distort(transformed(undistorted_from_picture, on_largest));
            if (at && cv::Rect2d(region).contains(*at)) {
                on_picture.emplace_back(on_largest);
                expected.emplace_back(*at - cv::Point2d(region.tl()));
            }
        }
        if (expected.size() < min_inliers)
            return std::nullopt;
        std::vector<std::uint8_t> is_found;
        cv::calcOpticalFlowPyrLK(normalized(drawn), normalized(frame(region)), expected, actual, is_found,
                                 cv::noArray(), {window_px, window_px}, levels);
        std::vector<cv::Point2f> found_on_picture, found_in_frame;
        for (std::size_t i = 0; i < is_found.size(); ++i)
            if (is_found[i]) {
                found_on_picture.push_back(on_picture[i]);
                found_in_frame.push_back(actual[i] + cv::Point2f(region.tl()));
            }
        const auto fitted = fit(camera, found_on_picture, found_in_frame, align_tolerance_px);
        if (!fitted)
            return std::nullopt;
        undistorted_from_picture = fitted->undistorted_from_picture;
        place.inliers = fitted->inliers;
        place.inlier_share = static_cast<double>(place.inliers) / static_cast<double>(expected.size());
        if (place.inlier_share < min_inlier_share)
            return std::nullopt;
    }
    if (!is_plausible(undistorted_from_picture, corners))
        return std::nullopt;
    place.corners_px = shown(corners);
    return place.corners_px.size() == corners.size() ? std::optional(place) : std::nullopt;
}

} // namespace tracker_image
