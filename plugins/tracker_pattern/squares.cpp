// SPDX-License-Identifier: Apache-2.0
#include "squares.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <numbers>

namespace tracker_pattern {
namespace {

using arhost::fiducial::Corners;

// Windows of the adaptive threshold, px. Small windows separate neighbouring squares; large windows keep wide borders
// closed.
constexpr int windows_px[] = {7, 21, 51};
// A pixel is dark if it is darker than the mean of its window by this number of levels.
constexpr double threshold_levels = 7;
// Maximum distance of a contour from the quadrilateral, relative to the perimeter.
constexpr double max_deviation = 0.03;

double shortest_side(const std::vector<cv::Point> &corners) {
    double shortest = cv::norm(corners[0] - corners[3]);
    for (std::size_t i = 0; i < 3; ++i)
        shortest = std::min(shortest, cv::norm(corners[i + 1] - corners[i]));
    return shortest;
}

} // namespace

std::vector<Corners> find_squares(const cv::Mat &grey, double min_side_px) {
    std::vector<Corners> squares;
    cv::Mat dark;
    std::vector<std::vector<cv::Point>> contours;
    std::vector<cv::Point> polygon;
    for (const int window : windows_px) {
        cv::adaptiveThreshold(grey, dark, 255, cv::ADAPTIVE_THRESH_MEAN_C, cv::THRESH_BINARY_INV, window,
                              threshold_levels);
        cv::findContours(dark, contours, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
        for (const std::vector<cv::Point> &contour : contours) {
            // The contour passes through the centres of the outermost pixels, in steps of at most √2 px.
            const double min_perimeter_px = 4 * (min_side_px - 1);
            if (static_cast<double>(contour.size()) * std::numbers::sqrt2 < min_perimeter_px)
                continue;
            const double perimeter_px = cv::arcLength(contour, true);
            if (perimeter_px < min_perimeter_px)
                continue;
            cv::approxPolyDP(contour, polygon, max_deviation * perimeter_px, true);
            if (polygon.size() != 4 || !cv::isContourConvex(polygon) || shortest_side(polygon) < min_side_px - 1)
                continue;
            // The outer contour of a dark region is counter-clockwise in the image; the contour of a hole is
            // clockwise.
            if (cv::contourArea(polygon, true) >= 0)
                continue;
            Corners corners;
            for (std::size_t i = 0; i < 4; ++i)
                corners[i] = polygon[3 - i];
            squares.push_back(corners);
        }
    }
    return squares;
}

} // namespace tracker_pattern
