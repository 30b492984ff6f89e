// SPDX-License-Identifier: Apache-2.0
#include "calibrate/coverage.hpp"

#include "base/text.hpp"

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <set>

namespace arhost::calibrate {

Coverage::Coverage(const Calibration &calibration) : image_(calibration.image) {
    for (const UsedView &used : calibration.used)
        add({"", {}, used.corners_px}, used.tilt);
}

std::size_t Coverage::index(const cv::Point2f &pixel) const {
    const auto cell = [](double px, int size, int count) {
        return std::clamp(static_cast<int>((px + 0.5) / size * count), 0, count - 1);
    };
    return index(cell(pixel.x, image_.width, columns), cell(pixel.y, image_.height, rows));
}

void Coverage::add(const View &view, const Tilt &tilt) {
    for (const cv::Point2f &pixel : view.image_px)
        covered_[index(pixel)] = true;
    const auto extend = [&](double Tilt::*axis) {
        lowest_.*axis = views_ == 0 ? tilt.*axis : std::min(lowest_.*axis, tilt.*axis);
        highest_.*axis = views_ == 0 ? tilt.*axis : std::max(highest_.*axis, tilt.*axis);
    };
    extend(&Tilt::about_vertical_degrees);
    extend(&Tilt::about_horizontal_degrees);
    ++views_;
}

double Coverage::fraction() const {
    return static_cast<double>(std::ranges::count(covered_, true)) / static_cast<double>(covered_.size());
}

std::size_t Coverage::new_cells(const View &view) const {
    std::set<std::size_t> cells;
    for (const cv::Point2f &pixel : view.image_px)
        if (!covered_[index(pixel)])
            cells.insert(index(pixel));
    return cells.size();
}

std::vector<std::string> Coverage::missing() const {
    // The corners of the image come first, because the lens distortion is largest there, and boards are rarely placed
    // there by chance.
    struct Region {
        int column, row;
        const char *name;
    };
    static constexpr Region regions[] = {
        {0, 0, "to the top left"},     {2, 0, "to the top right"}, {0, 2, "to the bottom left"},
        {2, 2, "to the bottom right"}, {1, 0, "to the top"},       {1, 2, "to the bottom"},
        {0, 1, "to the left"},         {2, 1, "to the right"},     {1, 1, "to the centre"}};
    constexpr int width = columns / 3, height = rows / 3;
    std::vector<std::string> instructions;
    for (const Region &region : regions) {
        int covered = 0;
        for (int row = 0; row < height; ++row)
            for (int column = 0; column < width; ++column)
                covered += is_covered(region.column * width + column, region.row * height + row) ? 1 : 0;
        if (2 * covered < width * height)
            instructions.push_back(fmt::format("move the board {} of the image", region.name));
    }
    const auto check = [&](double Tilt::*axis, const char *name, const char *lower_side, const char *higher_side) {
        const double lowest = lowest_.*axis, highest = highest_.*axis;
        if (highest - lowest < tilt_range_wanted_degrees)
            instructions.push_back(fmt::format("tilt the board more about its {} axis: bring its {} side nearer to "
                                               "the camera",
                                               name, highest > -lowest ? lower_side : higher_side));
    };
    check(&Tilt::about_vertical_degrees, "vertical", "left", "right");
    check(&Tilt::about_horizontal_degrees, "horizontal", "upper", "lower");
    if (views_ < views_wanted)
        instructions.push_back("take " + base::count_of(views_wanted - views_, "more view") + ", with other tilts");
    return instructions;
}

Placement placement_of(const View &view, const Tilt &tilt, const cv::Size &image) {
    const cv::Rect2f bounds = cv::boundingRect(view.image_px);
    constexpr double full_tilt_degrees = 60;
    return {(bounds.x + bounds.width / 2) / image.width, (bounds.y + bounds.height / 2) / image.height,
            std::sqrt(static_cast<double>(bounds.area()) / image.area()),
            tilt.about_vertical_degrees / full_tilt_degrees, tilt.about_horizontal_degrees / full_tilt_degrees};
}

double novelty(const Placement &placement, std::span<const Placement> others) {
    double nearest = INFINITY;
    for (const Placement &other : others) {
        double distance = 0;
        for (std::size_t k = 0; k < placement.size(); ++k)
            distance = std::max(distance, std::abs(placement[k] - other[k]));
        nearest = std::min(nearest, distance);
    }
    return nearest;
}

std::vector<std::size_t> select(std::span<const View> views, const cv::Size &image, const Lens &lens,
                                std::size_t count) {
    std::vector<Placement> placements, chosen_placements;
    std::vector<Tilt> tilts;
    for (const View &view : views) {
        tilts.push_back(tilt_of(view, lens));
        placements.push_back(placement_of(view, tilts.back(), image));
    }
    Coverage coverage(image);
    std::vector<std::size_t> chosen;
    std::vector<bool> is_chosen(views.size());
    while (chosen.size() < std::min(count, views.size())) {
        std::size_t best = 0;
        double most = -1;
        for (std::size_t i = 0; i < views.size(); ++i) {
            // A new cell counts as much as a tenth of the range of positions or tilts.
            const double gain = static_cast<double>(coverage.new_cells(views[i])) / 10 +
                                std::min(novelty(placements[i], chosen_placements), 1.0);
            if (!is_chosen[i] && gain > most) {
                most = gain;
                best = i;
            }
        }
        is_chosen[best] = true;
        chosen.push_back(best);
        chosen_placements.push_back(placements[best]);
        coverage.add(views[best], tilts[best]);
    }
    std::ranges::sort(chosen);
    return chosen;
}

} // namespace arhost::calibrate
