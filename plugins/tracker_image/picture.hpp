// SPDX-License-Identifier: Apache-2.0
//
// A planar picture, such as a poster or a book cover. This class finds the picture in a frame by its features, and
// aligns it with a frame in which its approximate position is known.
#pragma once

#include <fiducial/undistortion.hpp>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

#include <optional>
#include <string>
#include <vector>

namespace tracker_image {

// The camera of the frames. A homography relates a planar picture to the undistorted pixels of a frame
// (fiducial::Lens).
class Camera {
public:
    explicit Camera(const arhost_intrinsics &intrinsics);

    // Both functions return std::nullopt where the distortion model is not one-to-one.
    std::optional<cv::Point2d> undistort(cv::Point2d pixel) const;
    std::optional<cv::Point2d> distort(cv::Point2d undistorted_px) const;
    // Returns the undistorted pixel of each pixel in a region of the frame (CV_32FC2); NaN where there is none.
    cv::Mat undistorted(const cv::Rect &region) const { return undistorted_(region); }

private:
    arhost::fiducial::Lens lens_;
    cv::Mat undistorted_; // undistorted pixels of all pixels of a frame
};

// The features of a frame, which are used for all pictures.
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

    // The position of the picture in a frame, and the quality of the fit.
    struct Place {
        std::vector<cv::Point2d> corners_px; // clockwise from the top left one
        std::size_t inliers;                 // points of the picture that were found at this place
        double inlier_share;                 // inliers divided by the number of points that should be visible
    };
    // Returns the places of all copies of the picture. `features`: must be the features of `frame`.
    std::vector<Place> find(const cv::Mat &frame, const Camera &camera, const Features &features) const;
    // `corners_px`: expected positions of the corners, clockwise from the top left one.
    std::optional<Place> align(const cv::Mat &frame, const Camera &camera,
                               const std::vector<cv::Point2d> &corners_px) const;

private:
    // The picture at one of several sizes. The sides of each level are 1/sqrt(2) of those of the previous level.
    struct Level {
        cv::Mat grey;
        std::vector<cv::Point2f> points; // points with texture in both directions, for the alignment
    };

    // `undistorted_from_picture`: maps pixels of the largest level to undistorted pixels.
    std::optional<Place> align(const cv::Mat &frame, const Camera &camera,
                               cv::Matx33d undistorted_from_picture) const;
    std::vector<cv::Point2f> own_corners() const;
    const Level &level_for(double area_px) const;

    double aspect_;
    std::vector<Level> levels_;
    Features features_; // features of the largest level
};

} // namespace tracker_image
