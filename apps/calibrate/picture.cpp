// SPDX-License-Identifier: Apache-2.0
#include "calibrate/picture.hpp"

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>

namespace arhost::calibrate {
namespace {

const cv::Scalar white(255, 255, 255), black(0, 0, 0), grey(190, 190, 190), shade(215, 215, 245), dark(90, 90, 90);

// Returns the smallest number of the series 1, 2, 5, 10, … times a power of ten that is at least `value`.
double round_up(double value) {
    const double power = std::pow(10, std::floor(std::log10(std::max(value, 1e-6))));
    for (const double step : {1.0, 2.0, 5.0})
        if (step * power >= value)
            return step * power;
    return 10 * power;
}

// Colours from 0 (blue) to 1 (red).
class Colours {
public:
    Colours() {
        cv::Mat ramp(1, 256, CV_8U);
        for (int i = 0; i < 256; ++i)
            ramp.at<std::uint8_t>(i) = static_cast<std::uint8_t>(20 + i * 215 / 255); // the ends are almost black
        cv::applyColorMap(ramp, table_, cv::COLORMAP_TURBO);
    }
    cv::Scalar at(double fraction) const {
        return cv::Scalar(table_.at<cv::Vec3b>(cvRound(std::clamp(fraction, 0.0, 1.0) * 255)));
    }

private:
    cv::Mat table_;
};

void write(cv::Mat &picture, const std::string &text, const cv::Point &at) {
    cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, 0.5, black, 1, cv::LINE_AA);
}

} // namespace

cv::Mat coverage_picture(std::span<const View> views, const Calibration &calibration, const Coverage &coverage) {
    constexpr int longer_side = 1000, legend_height = 96, margin = 12;
    const cv::Size image = calibration.image;
    const double scale = static_cast<double>(longer_side) / std::max(image.width, image.height);
    const cv::Size map(std::max(cvRound(image.width * scale), 480), std::max(cvRound(image.height * scale), 100));
    cv::Mat picture(map.height + legend_height, map.width, CV_8UC3, white);
    for (int row = 0; row < Coverage::rows; ++row)
        for (int column = 0; column < Coverage::columns; ++column) {
            const auto corner = [&](int c, int r) {
                return cv::Point(map.width * c / Coverage::columns, map.height * r / Coverage::rows);
            };
            const cv::Rect cell(corner(column, row), corner(column + 1, row + 1));
            if (!coverage.is_covered(column, row))
                cv::rectangle(picture, cell, shade, cv::FILLED);
            cv::rectangle(picture, cell, grey);
        }
    cv::rectangle(picture, cv::Rect({0, 0}, map), dark);

    constexpr int fraction_bits = 4; // of coordinates
    const auto position = [&](const cv::Point2f &pixel) {
        return cv::Point(cvRound((pixel.x + 0.5) * map.width / image.width * (1 << fraction_bits)),
                         cvRound((pixel.y + 0.5) * map.height / image.height * (1 << fraction_bits)));
    };
    const Colours colours;
    const double highest_px = round_up(2 * calibration.error_px);
    for (const DroppedView &dropped : calibration.dropped)
        for (const cv::Point2f &pixel : views[dropped.index].image_px) {
            const cv::Point at = position(pixel);
            cv::drawMarker(picture, {at.x >> fraction_bits, at.y >> fraction_bits}, dark, cv::MARKER_TILTED_CROSS, 7,
                           1, cv::LINE_AA);
        }
    for (const UsedView &used : calibration.used)
        for (std::size_t i = 0; i < used.residuals_px.size(); ++i)
            cv::circle(picture, position(used.corners_px[i]), 4 << fraction_bits,
                       colours.at(used.residuals_px[i] / highest_px), cv::FILLED, cv::LINE_AA, fraction_bits);

    std::size_t corners = 0;
    for (const UsedView &used : calibration.used)
        corners += used.residuals_px.size();
    const int top = map.height + 24;
    write(picture,
          fmt::format("{} corners of {} views, {:.0f} % of the cells covered; RMS error {:.2f} px", corners,
                      calibration.used.size(), 100 * coverage.fraction(), calibration.error_px),
          {margin, top});
    constexpr int bar_width = 256, bar_height = 14;
    const int bar_top = top + 14;
    for (int x = 0; x < bar_width; ++x)
        cv::line(picture, {margin + x, bar_top}, {margin + x, bar_top + bar_height},
                 colours.at(x / (bar_width - 1.0)));
    for (int tick = 0; tick <= 2; ++tick)
        write(picture, fmt::format("{:g}{}", highest_px * tick / 2, tick == 2 ? " px or more" : ""),
              {margin + bar_width * tick / 2 - (tick == 0 ? 0 : 8), bar_top + bar_height + 18});
    const int right = margin + bar_width + 24;
    write(picture, "error of a corner", {right, bar_top + 12});
    cv::rectangle(picture, {right + 170, bar_top, bar_height, bar_height}, shade, cv::FILLED);
    cv::rectangle(picture, {right + 170, bar_top, bar_height, bar_height}, grey);
    write(picture, "no corner", {right + 192, bar_top + 12});
    if (!calibration.dropped.empty()) {
        cv::drawMarker(picture, {right + 300, bar_top + 7}, dark, cv::MARKER_TILTED_CROSS, 9, 1, cv::LINE_AA);
        write(picture, "view left out", {right + 312, bar_top + 12});
    }
    return picture;
}

} // namespace arhost::calibrate
