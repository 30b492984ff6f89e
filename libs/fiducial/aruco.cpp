// SPDX-License-Identifier: Apache-2.0
#include "aruco.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>

namespace arhost::aruco {
namespace {

using fiducial::Corners;
using fiducial::unwarped;

// Returns whether the middle of each cell is uniform, which means that all its samples lie on the side of the
// threshold that `white` states.
bool is_uniform(const cv::Mat &grey, const Corners &corners_px, const cv::Mat_<std::uint8_t> &white,
                double threshold) {
    const cv::Mat_<std::uint8_t> samples = unwarped(grey, corners_px, 4 * white.rows);
    for (int row = 0; row < white.rows; ++row)
        for (int column = 0; column < white.cols; ++column)
            for (const int y : {4 * row + 1, 4 * row + 2})
                for (const int x : {4 * column + 1, 4 * column + 2})
                    if ((samples(y, x) > threshold) != (white(row, column) != 0))
                        return false;
    return true;
}

} // namespace

double default_correction_rate(const cv::aruco::Dictionary &dictionary) {
    constexpr double rate = 0.6;
    const int size = dictionary.markerSize;
    if (size > 6 || dictionary.maxCorrectionBits <= 0)
        return rate;
    const int errors = size <= 4 ? 0 : size == 5 ? 1 : 3;
    // Adds 0.5, because OpenCV rounds the product down.
    return std::min(rate, (errors + 0.5) / dictionary.maxCorrectionBits);
}

Reading read(const cv::Mat &grey, const Corners &corners_px, const cv::aruco::Dictionary &dictionary, int id,
             int border_bits, bool is_oriented) {
    const int cells = dictionary.markerSize + 2 * border_bits, bits = dictionary.markerSize * dictionary.markerSize;
    const cv::Mat_<std::uint8_t> levels = unwarped(grey, corners_px, cells);
    cv::Mat_<std::uint8_t> white;
    cv::threshold(levels, white, 0, 1, cv::THRESH_BINARY | cv::THRESH_OTSU);
    const cv::Mat black = 1 - white;
    const double white_level = cv::mean(levels, white)[0], black_level = cv::mean(levels, black)[0];
    const cv::Rect code(border_bits, border_bits, dictionary.markerSize, dictionary.markerSize);
    const int wrong_bits = dictionary.getDistanceToId(white(code), id, !is_oriented),
              wrong_bits_inverted = dictionary.getDistanceToId(black(code), id, !is_oriented);
    const bool is_inverted = wrong_bits_inverted < wrong_bits;
    const cv::Mat unlike_border = is_inverted ? black : white;
    Reading reading{static_cast<std::uint32_t>(std::min(wrong_bits, wrong_bits_inverted)),
                    cv::countNonZero(unlike_border) == cv::countNonZero(unlike_border(code)),
                    (white_level - black_level) / 2, 0};
    reading.false_positive_rate = fiducial::false_positive_rate(bits, reading.wrong_bits);
    // Squares in clutter often match a code of 4×4 bits, but most cells of such squares are not uniform.
    if (bits <= 16) {
        cv::Mat_<std::uint8_t> expected(cells, cells, is_inverted ? 1 : 0); // the border
        white(code).copyTo(expected(code));
        if (!is_uniform(grey, corners_px, expected, (white_level + black_level) / 2))
            reading.false_positive_rate = 1;
    }
    return reading;
}

} // namespace arhost::aruco
