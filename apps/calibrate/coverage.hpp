// SPDX-License-Identifier: Apache-2.0
//
// Which parts of the image and which tilts a set of views covers.
#pragma once

#include "calibrate/calibration.hpp"

namespace arhost::calibrate {

constexpr std::size_t views_wanted = 10;
constexpr double tilt_range_wanted_degrees = 30; // between the extreme views, about either axis

// The image is divided into 3 × 3 regions of 3 × 2 cells.
class Coverage {
public:
    static constexpr int columns = 9, rows = 6;

    explicit Coverage(const cv::Size &image) : image_(image) {}
    explicit Coverage(const Calibration &calibration);

    void add(const View &view, const Tilt &tilt);

    bool is_covered(int column, int row) const { return covered_[index(column, row)]; }
    double fraction() const; // fraction of the cells that contain corners
    std::size_t new_cells(const View &view) const;
    Tilt lowest() const { return lowest_; }
    Tilt highest() const { return highest_; }
    // Instructions that complete the coverage, the most important first. Empty if it is complete.
    std::vector<std::string> missing() const;

private:
    static std::size_t index(int column, int row) { return static_cast<std::size_t>(row * columns + column); }
    std::size_t index(const cv::Point2f &pixel) const;

    cv::Size image_;
    std::array<bool, static_cast<std::size_t>(columns) * rows> covered_{};
    Tilt lowest_, highest_;
    std::size_t views_ = 0;
};

// Position of a board in the image, and its tilts; each number is 0 to about 1.
using Placement = std::array<double, 5>;
Placement placement_of(const View &view, const Tilt &tilt, const cv::Size &image);
// Returns the distance to the nearest other placement; infinite if there is none.
double novelty(const Placement &placement, std::span<const Placement> others);

// Returns the indices of at most `count` views that together cover most parts of the image and most tilts, in
// increasing order.
std::vector<std::size_t> select(std::span<const View> views, const cv::Size &image, const Lens &lens,
                                std::size_t count);

} // namespace arhost::calibrate
