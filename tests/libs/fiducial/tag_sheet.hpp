// SPDX-License-Identifier: Apache-2.0
//
// Pictures of a sheet with many tags of tag36h11, as a camera sees them that is out of focus or overexposed.
#pragma once

#include "prints.hpp"

#include <array>

namespace arhost::test {

struct Exposure {
    const char *name;
    double blur_px;        // standard deviation
    double brightness = 1; // 1: white is 220 of 255
};
constexpr std::array exposures = {Exposure{"sharp", 0.6}, Exposure{"blurred", 2.5}, Exposure{"overexposed", 0.6, 1.5},
                                  Exposure{"both", 2.5, 1.5}};

// Tags in rows, numbered from 0. The sheet is slightly turned and tilted.
struct TagSheet {
    cv::Size size;  // of the picture
    cv::Size tags;  // number of columns and rows
    double side_px; // of the squares

    int count() const { return tags.area(); }

    GreyFrame frame(const Exposure &exposure) const {
        constexpr int cell_samples = 4, fine = 4; // samples per cell; times the resolution
        const int square = april_tag("tag36h11", 0).corner_cells, pitch = square + square / 2; // cells
        cv::Mat_<float> sheet(tags.height * pitch, tags.width * pitch, 220.0F);
        for (int id = 0; id < count(); ++id) {
            cv::Mat_<float> cells;
            april_tag("tag36h11", id).cells.convertTo(cells, CV_32F, 190.0 / 255, 30);
            const int margin = (pitch - cells.cols) / 2;
            cells.copyTo(sheet(cv::Rect(id % tags.width * pitch + margin, id / tags.width * pitch + margin,
                                        cells.cols, cells.rows)));
        }
        cv::resize(sheet, sheet, {}, cell_samples, cell_samples, cv::INTER_NEAREST);
        const double px_per_cell = side_px / square, angle = 0.03, tilt = 0.00002;
        const cv::Matx33d to_origin(1.0 / cell_samples, 0, -sheet.cols / 2.0 / cell_samples, 0, 1.0 / cell_samples,
                                    -sheet.rows / 2.0 / cell_samples, 0, 0, 1),
            to_px(px_per_cell * std::cos(angle), -px_per_cell * std::sin(angle), 0, px_per_cell * std::sin(angle),
                  px_per_cell * std::cos(angle), 0, tilt, tilt, 1),
            to_fine(fine, 0, fine * size.width / 2.0, 0, fine, fine * size.height / 2.0, 0, 0, 1);
        cv::Mat picture, reduced;
        cv::warpPerspective(sheet, picture, to_fine * to_px * to_origin, size * fine, cv::INTER_LINEAR,
                            cv::BORDER_CONSTANT, 120);
        cv::GaussianBlur(picture, picture, {}, fine * exposure.blur_px);
        cv::resize(picture, reduced, size, 0, 0, cv::INTER_AREA);
        reduced.convertTo(reduced, CV_16S, exposure.brightness); // noise comes before saturation
        add_noise(reduced, 1.5, 1);
        return GreyFrame(reduced);
    }
};
constexpr double sheet_side_px = 40;
const TagSheet few_tags{{640, 480}, {4, 4}, sheet_side_px}, many_tags{{1280, 960}, {20, 14}, sheet_side_px};

} // namespace arhost::test
