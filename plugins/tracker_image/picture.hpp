// SPDX-License-Identifier: Apache-2.0
//
// A plane picture, such as a poster or the cover of a book: finds it in a frame by its features, and aligns it with a
// frame in which its place is roughly known.
#pragma once

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

#include <optional>
#include <string>
#include <vector>

namespace tracker_image {

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
        cv::Matx33d frame_from_picture; // from pixels of the largest level
        std::size_t inliers;            // points of the picture that were found there
        double inlier_share;            // of the points that should be visible
    };
    // The features must be those of `frame`.
    std::optional<Place> find(const cv::Mat &frame, const Features &features) const;
    // `corners_px`: where the corners are expected, from the top left one clockwise.
    std::optional<Place> align(const cv::Mat &frame, const std::vector<cv::Point2f> &corners_px) const;

    std::vector<cv::Point2d> corners_px(const Place &place) const;

private:
    // The picture at one of several sizes, each 1/sqrt(2) of the one before.
    struct Level {
        cv::Mat grey;
        std::vector<cv::Point2f> points; // with texture in both directions, for the alignment
    };

    std::optional<Place> align(const cv::Mat &frame, const cv::Matx33d &frame_from_picture) const;
    std::vector<cv::Point2f> own_corners() const;
    const Level &level_for(double area_px) const;

    double aspect_;
    std::vector<Level> levels_;
    Features features_; // of the largest level
};

} // namespace tracker_image
