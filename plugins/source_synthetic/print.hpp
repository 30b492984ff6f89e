// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <string>

namespace arhost::synthetic {

// What a printer put on a sheet, 0 to 255. Positions in mm from the sheet's upper left corner.
class Print {
public:
    Print(float width_mm, float height_mm, int px_per_mm)
        : scale_(px_per_mm), ink_(static_cast<int>(height_mm * static_cast<float>(px_per_mm)),
                                  static_cast<int>(width_mm * static_cast<float>(px_per_mm)), uint8_t{0}) {}

    // The baseline's left end, or its middle.
    void text(const std::string &line, double x, double y, double capital_mm, double pen_mm = 0.28,
              bool centred = false) {
        const int font = cv::FONT_HERSHEY_DUPLEX; // capitals are 21 units high
        const double size = capital_mm * scale_ / 21;
        const int pen = std::max(1, static_cast<int>(std::lround(pen_mm * scale_)));
        int below = 0;
        const int width = cv::getTextSize(line, font, size, pen, &below).width;
        cv::putText(ink_, line, {px(x) - (centred ? width / 2 : 0), px(y)}, font, size, 255, pen, cv::LINE_AA);
    }
    void line(double x0, double y0, double x1, double y1, double pen_mm) {
        cv::line(ink_, {px(x0), px(y0)}, {px(x1), px(y1)}, 255, std::max(1, px(pen_mm)), cv::LINE_AA);
    }
    void bar(double x0, double y0, double x1, double y1, int tone = 255) {
        cv::rectangle(ink_, {px(x0), px(y0)}, {px(x1) - 1, px(y1) - 1}, tone, cv::FILLED);
    }

    // The mean, 0 to 1, over a texel.
    float operator()(float x, float y, float texel) const {
        const int n = std::max(1, static_cast<int>(texel * static_cast<float>(scale_) + 0.5f));
        const int left = px(x - texel / 2), top = px(y - texel / 2);
        if (left < 0 || top < 0 || left + n > ink_.cols || top + n > ink_.rows)
            return 0;
        int sum = 0;
        for (int row = top; row < top + n; ++row)
            for (int column = left; column < left + n; ++column)
                sum += ink_(row, column);
        return static_cast<float>(sum) / static_cast<float>(255 * n * n);
    }

private:
    int px(double mm) const { return static_cast<int>(std::lround(mm * scale_)); }
    int scale_;
    cv::Mat_<uint8_t> ink_;
};

} // namespace arhost::synthetic
