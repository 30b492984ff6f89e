// SPDX-License-Identifier: Apache-2.0
#include <tracker_pattern/squares.hpp>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

namespace {

cv::Mat with_square(double side_px, double degrees) {
    cv::Mat picture(300, 300, CV_8UC1, cv::Scalar(220));
    cv::Point2f corners[4];
    cv::RotatedRect({150.3F, 149.6F}, cv::Size2d(side_px, side_px), static_cast<float>(degrees)).points(corners);
    constexpr int fraction_bits = 8;
    std::vector<cv::Point> polygon;
    for (const cv::Point2f &corner : corners)
        polygon.emplace_back(corner * static_cast<float>(1 << fraction_bits));
    cv::fillConvexPoly(picture, polygon, cv::Scalar(30), cv::LINE_AA, fraction_bits);
    return picture;
}

TEST(Squares, AreFoundFromTheirShortestSideInEveryDirection) {
    for (const double min_side_px : {12.0, 40.0, 100.0})
        for (const double degrees : {0, 10, 22, 30, 45, 60}) {
            EXPECT_FALSE(
                tracker_pattern::find_squares(with_square(1.06 * min_side_px + 1, degrees), min_side_px).empty())
                << min_side_px << " px, " << degrees;
            EXPECT_TRUE(
                tracker_pattern::find_squares(with_square(0.9 * min_side_px - 2, degrees), min_side_px).empty())
                << min_side_px << " px, " << degrees;
        }
}

} // namespace
