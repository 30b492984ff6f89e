// SPDX-License-Identifier: Apache-2.0
//
// A plane picture, such as a poster or the cover of a book: finds it in a frame by its features, and aligns it with a
// frame in which its place is roughly known.
#pragma once

#include <fiducial/undistortion.hpp>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

#include <optional>
#include <string>
#include <vector>

namespace tracker_image {

// The camera of the frames. In undistorted pixels (fiducial::Lens), a plane picture is related to a frame by a
// homography.
class Camera {
public:
    explicit Camera(const arhost_intrinsics &intrinsics);

    // Both return std::nullopt where the distortion model is not one-to-one.
    std::optional<cv::Point2d> undistort(cv::Point2d pixel) const;
    std::optional<cv::Point2d> distort(cv::Point2d undistorted_px) const;
    // For each pixel of a region of the frame, the undistorted pixel (CV_32FC2); NaN where there is none.
    cv::Mat undistorted(const cv::Rect &region) const { return undistorted_(region); }

private:
    arhost::fiducial::Lens lens_;
    cv::Mat undistorted_; // of all pixels of a frame
};

// The features of a frame, which all pictures share.
struct Features {
    std::vector<cv::KeyPoint> points;
    cv::Mat descriptors;
};
Features features_of(const cv::Mat &grey);

class Picture {
public:
    // Throws Failure(ARHOST_STATUS_ERROR_CONFIGURATION) if the file is not an image, or has too little texture.
    explicit Picture(const std::string &file);

    // Height divided by width.
    double aspect() const { return aspect_; }

    // Where the picture is in a frame, and how well it fits.
    struct Place {
        std::vector<cv::Point2d> corners_px; // from the top left one clockwise
        std::size_t inliers;                 // points of the picture that were found there
        double inlier_share;                 // of the points that should be visible
    };
    // The features must be those of `frame`.
    std::optional<Place> find(const cv::Mat &frame, const Camera &camera, const Features &features) const;
    // `corners_px`: where the corners are expected, from the top left one clockwise.
    std::optional<Place> align(const cv::Mat &frame, const Camera &camera,
                               const std::vector<cv::Point2d> &corners_px) const;

private:
    // The picture at one of several sizes, each 1/sqrt(2) of the one before.
    struct Level {
        cv::Mat grey;
        std::vector<cv::Point2f> points; // with texture in both directions, for the alignment
    };

    // `undistorted_from_picture`: to undistorted pixels from pixels of the largest level.
    std::optional<Place> align(const cv::Mat &frame, const Camera &camera,
                               cv::Matx33d undistorted_from_picture) const;
    std::vector<cv::Point2f> own_corners() const;
    const Level &level_for(double area_px) const;

    double aspect_;
    std::vector<Level> levels_;
    Features features_; // of the largest level
};

} // namespace tracker_image
