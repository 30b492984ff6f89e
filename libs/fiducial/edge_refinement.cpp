// SPDX-License-Identifier: Apache-2.0
#include "corner_refinement.hpp"
#include "fits.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

namespace arhost::fiducial {
namespace {

struct Line {
    cv::Point2d point, direction;
};

struct Picture {
    const cv::Mat &grey;
    const LightOfCode &light;

    // Returns whether light_at() can interpolate at this point; false for NaN.
    bool contains(cv::Point2d at) const {
        return at.x >= 0 && at.y >= 0 && at.x < grey.cols - 1 && at.y < grey.rows - 1;
    }
    float light_at(cv::Point2d at) const {
        const int x = static_cast<int>(at.x), y = static_cast<int>(at.y); // faster than std::floor
        const float a = static_cast<float>(at.x - x), b = static_cast<float>(at.y - y);
        const std::uint8_t *upper = grey.ptr(y) + x;
        const std::uint8_t *lower = upper + grey.step;
        return (1 - b) * ((1 - a) * light[upper[0]] + a * light[upper[1]]) +
               b * ((1 - a) * light[lower[0]] + a * light[lower[1]]);
    }
};

// Positions along an edge and the unit normals at them, which point out of the square.
struct Edge {
    std::vector<cv::Point2d> at_px, outward;
};

// The constants are in steps along the normal. The length of a step depends on the size of the marker and on the
// blur.
constexpr int search = 9, half_baseline = 3, reach = search + half_baseline;

// Returns how much the light rises over the baseline, outwards, times `sign`: one row for each position, one
// column for each offset from −search to search. The rise is 0 where the baseline leaves the image.
cv::Mat_<float> rises(const Picture &picture, const Edge &edge, double step_px, double sign) {
    cv::Mat_<float> result(static_cast<int>(edge.at_px.size()), 2 * search + 1);
    constexpr float outside = std::numeric_limits<float>::quiet_NaN();
    std::array<float, 2 * reach + 1> profile;
    for (int row = 0; row < result.rows; ++row) {
        const cv::Point2d step = step_px * edge.outward[row], first = edge.at_px[row] - reach * step;
        const bool is_inside = picture.contains(first) && picture.contains(first + 2 * reach * step);
        for (int i = 0; i <= 2 * reach; ++i) {
            const cv::Point2d at = first + i * step;
            profile[i] = is_inside || picture.contains(at) ? picture.light_at(at) : outside;
        }
        for (int column = 0; column < result.cols; ++column) {
            const float rise = static_cast<float>(sign) * (profile[column + 2 * half_baseline] - profile[column]);
            result(row, column) = std::isfinite(rise) ? rise : 0;
        }
    }
    return result;
}

// Returns how much the light rises from `distance_px` inside the edge to `distance_px` outside it, summed over the
// positions.
double rise_across(const Picture &picture, const Edge &edge, double distance_px) {
    double sum = 0;
    for (std::size_t i = 0; i < edge.at_px.size(); ++i) {
        const cv::Point2d step = distance_px * edge.outward[i], inside = edge.at_px[i] - step,
                          outside = edge.at_px[i] + step;
        if (picture.contains(inside) && picture.contains(outside))
            sum += picture.light_at(outside) - picture.light_at(inside);
    }
    return sum;
}

using MeanRises = std::array<float, 2 * search + 1>; // over all positions, one for each offset

MeanRises mean_of_rows(const cv::Mat_<float> &rises) {
    MeanRises mean{};
    for (int row = 0; row < rises.rows; ++row)
        for (std::size_t i = 0; i < mean.size(); ++i)
            mean[i] += rises(row, static_cast<int>(i));
    for (float &rise : mean)
        rise /= static_cast<float>(rises.rows);
    return mean;
}

// The distance in px from which positions on an edge count as independent, if the noise of pixels is independent.
// Closer positions share pixels. The value is the integral of the autocorrelation of bilinear samples.
constexpr double correlation_px = 1.5;

// The rises near an edge. The mean rise at an offset is the mean over all positions.
// - `peak`: the greatest mean rise.
// - `at_rim`: the greatest mean rise at the outermost offsets.
// - `on_line`: the mean rise at offset 0 with the smallest step.
// - `width_px`: the width of a slope with the same sum whose rise is `peak` everywhere.
// - `noise`: the standard deviation of a rise before reduce_noise(), relative to `peak`.
// - `averaged`: the number of rows that reduce_noise() averages to obtain one row.
struct Slope {
    cv::Mat_<float> rises;
    double step_px, peak = 0, at_rim = 0, on_line = 0, width_px = 0, noise = 0;
    int averaged = 1;

    // Returns the standard deviation of the blur. It includes the averaging of light over square pixels. It excludes
    // two other causes that widen the slope: the baseline (a uniform distribution) and the interpolation (a
    // triangular one).
    double blur_px() const {
        constexpr double min_blur_px = 0.3, interpolation_variance = 1.0 / 6;
        const double baseline_px = 2 * half_baseline * step_px;
        return std::sqrt(std::max(width_px * width_px / (2 * std::numbers::pi) - baseline_px * baseline_px / 12 -
                                      interpolation_variance,
                                  min_blur_px * min_blur_px));
    }
};

constexpr std::size_t few_positions = 8, min_positions = 16, max_positions = 100; // per edge

constexpr double contained = 0.35; // if `at_rim` divided by `peak` is below this value, the slope ends before the rim

// Doubles the step, up to `max_step_px`, until the search range contains the whole slope, which blur widens.
Slope find_slope(const Picture &picture, const Edge &edge, double min_step_px, double max_step_px, double sign) {
    constexpr int rim = 3; // columns
    Slope slope{{}, min_step_px};
    for (;; slope.step_px = std::min(2 * slope.step_px, max_step_px)) {
        slope.rises = rises(picture, edge, slope.step_px, sign);
        const MeanRises mean = mean_of_rows(slope.rises);
        if (slope.step_px == min_step_px)
            slope.on_line = mean[search];
        slope.peak = *std::max_element(mean.begin(), mean.end());
        slope.at_rim = std::max(*std::max_element(mean.begin(), mean.begin() + rim),
                                *std::max_element(mean.end() - rim, mean.end()));
        double sum = 0;
        for (const float rise : mean)
            sum += std::max(rise, 0.0F);
        slope.width_px = sum / slope.peak * slope.step_px;
        if (slope.at_rim < contained * slope.peak || slope.step_px >= max_step_px)
            return slope;
    }
}

// Averages the rises of neighbouring positions until their noise is small relative to the slope. Sets `noise`.
void reduce_noise(Slope &slope) {
    constexpr double max_noise = 0.08; // relative to the peak
    // Differences between neighbouring rises contain all the noise, but little of the picture.
    std::vector<float> steps;
    for (int row = 1; row < slope.rises.rows; ++row)
        for (int column = 0; column < slope.rises.cols; column += half_baseline)
            steps.push_back(std::abs(slope.rises(row, column) - slope.rises(row - 1, column)));
    const double noise = 1.05 * median(steps); // standard deviation of a rise, if rises are normally distributed
    const double ratio = noise / (max_noise * slope.peak);
    const int averaged = static_cast<int>(std::min(ratio * ratio, slope.rises.rows / 4.0));
    if (averaged > 2) {
        slope.averaged = (averaged - 1) | 1; // an odd number
        cv::blur(slope.rises, slope.rises, {1, slope.averaged});
    }
    slope.noise = noise / slope.peak;
}

// Returns the offset of the edge in px: the mean of the offsets, weighted by the square of how much the rise exceeds
// `min_rise`. Returns std::nullopt if no rise exceeds it.
std::optional<double> edge_offset_px(const Slope &slope, int row, double min_rise) {
    double weighted = 0, weights = 0;
    for (int i = -search; i <= search; ++i)
        if (const double above = slope.rises(row, i + search) - min_rise; above > 0) {
            weighted += above * above * i;
            weights += above * above;
        }
    return weights > 0 ? std::optional(weighted / weights * slope.step_px) : std::nullopt;
}

struct FittedEdge {
    Line line;                             // the errors of offset and direction are independent at `point`
    double offset_variance, turn_variance; // px², rad²
    double blur_px, correlation;           // see BlurredEdge

    // Returns the variance of the distance between the fitted line and the true line beside `at`.
    double variance_at(cv::Point2d at) const {
        const double along_px = line.direction.dot(at - line.point);
        return offset_variance + along_px * along_px * turn_variance;
    }
};

// `dependent`: the number of neighbouring points that have the same error.
FittedEdge fit_line(const std::vector<cv::Point2f> &points, double dependent) {
    cv::Vec4f fitted;
    cv::fitLine(points, fitted, cv::DIST_L2, 0, 0, 0);
    FittedEdge edge{{cv::Point2d(fitted[2], fitted[3]), cv::Point2d(fitted[0], fitted[1])}, 0, 0, 0, 0};
    const auto count = static_cast<double>(points.size());
    double across_squares = 0, along_squares = 0;
    for (const cv::Point2f &point : points) {
        const cv::Point2d from_centroid = cv::Point2d(point) - edge.line.point;
        across_squares += std::pow(edge.line.direction.cross(from_centroid), 2);
        along_squares += std::pow(edge.line.direction.dot(from_centroid), 2);
    }
    // A line has two degrees of freedom.
    edge.offset_variance = across_squares / count / std::max(count / dependent - 2, 1.0);
    edge.turn_variance = edge.offset_variance * count / along_squares;
    return edge;
}

// Tries lines through two points, and returns the points closer than `tolerance_px` to the line with most such
// points.
std::vector<cv::Point2f> most_collinear(const std::vector<cv::Point2f> &points, double tolerance_px) {
    constexpr std::size_t ends = 16; // number of points that are tried as an end of the line
    const std::size_t stride = std::max<std::size_t>(points.size() / ends, 1);
    std::vector<cv::Point2f> best, near;
    for (std::size_t i = 0; i < points.size(); i += stride)
        for (std::size_t j = i + stride; j < points.size(); j += stride) {
            const cv::Point2d along = points[j] - points[i];
            near.clear();
            for (const cv::Point2f &point : points)
                if (std::abs(along.cross(point - points[i])) < tolerance_px * cv::norm(along))
                    near.push_back(point);
            if (near.size() > best.size())
                best = near;
        }
    return best;
}

// Fits a line without outliers. `sampled` is the number of positions at which the edge was searched. Returns
// std::nullopt if fewer than half of `sampled` points remain, or if the median distance of the points from the line
// is `max_median_px` or more.
std::optional<FittedEdge> fit_line_robustly(std::vector<cv::Point2f> points, std::size_t sampled,
                                            double max_median_px, double dependent) {
    constexpr double min_inlier_px = 0.3;
    for (int round = 0;; ++round) {
        if (points.size() < std::max<std::size_t>(sampled / 2, 2))
            return std::nullopt;
        const FittedEdge edge = fit_line(points, dependent);
        const Line &line = edge.line;
        std::vector<double> residuals;
        residuals.reserve(points.size());
        for (const cv::Point2f &point : points)
            residuals.push_back(std::abs(line.direction.cross(cv::Point2d(point) - line.point)));
        std::vector<double> sorted = residuals;
        const double median_px = median(sorted), bound = std::max(min_inlier_px, 2.5 * median_px);
        std::vector<cv::Point2f> kept;
        for (std::size_t i = 0; i < points.size(); ++i)
            if (residuals[i] <= bound)
                kept.push_back(points[i]);
        if (kept.size() == points.size() || round == 5)
            return median_px < max_median_px ? std::optional(edge) : std::nullopt;
        points = std::move(kept);
    }
}

// Returns `count` positions on the edge between two corners, which are in undistorted pixels and in clockwise order.
// Keeps `margin_px` away from the corners, because the search would hit the adjacent edges there. Returns
// std::nullopt if the edge is outside the field of view of the lens.
std::optional<Edge> edge_between(cv::Point2d from, cv::Point2d to, const Lens &lens, double margin_px,
                                 std::size_t count) {
    const double length = cv::norm(to - from);
    const double margin = std::min(margin_px, length / 4) / length;
    std::vector<cv::Point2d> straight;
    for (std::size_t i = 0; i < count; ++i)
        straight.push_back(from + (margin + (1 - 2 * margin) * static_cast<double>(i) / (count - 1)) * (to - from));
    const auto bent = lens.distort(straight);
    if (!bent)
        return std::nullopt;
    Edge edge{*bent, {}};
    for (std::size_t i = 0; i < count; ++i) {
        const cv::Point2d along = edge.at_px[std::min(i + 1, count - 1)] - edge.at_px[i > 0 ? i - 1 : 0];
        edge.outward.push_back(cv::Point2d(along.y, -along.x) / cv::norm(along));
    }
    return edge;
}

// Returns the number of positions to sample between two points.
std::size_t count_of(cv::Point2d from, cv::Point2d to, double per_px) {
    // Clamps before the conversion: corners may be so far apart that their distance exceeds any integer.
    return static_cast<std::size_t>(std::clamp<double>(per_px * cv::norm(to - from), min_positions, max_positions));
}

// Returns how much the light changes per code, at the mean code along an edge.
double code_step(const Picture &picture, const Edge &edge) {
    double sum = 0;
    for (const cv::Point2d &at : edge.at_px)
        sum += picture.grey.at<std::uint8_t>(std::clamp(cvRound(at.y), 0, picture.grey.rows - 1),
                                             std::clamp(cvRound(at.x), 0, picture.grey.cols - 1));
    const std::size_t code =
        std::min(static_cast<std::size_t>(sum / static_cast<double>(edge.at_px.size())), std::size_t{254});
    return picture.light[code + 1] - picture.light[code];
}

// Fits a line in undistorted pixels to the slope of an edge. `from`: a corner near the edge.
std::optional<FittedEdge> fit_edge(const Picture &picture, const Edge &edge, Slope &slope, double cell_px,
                                   cv::Point2d from, const Lens &lens) {
    constexpr double max_median_steps = 4;
    if (!(slope.peak >= code_step(picture, edge)))
        return std::nullopt;
    reduce_noise(slope);
    // `min_rise` is relative to the peak. The wider a slope is relative to the cell, the more its flanks depend on
    // the cells beside the border and the margin. A wide slope is therefore used only above a larger rise.
    const double min_rise = std::clamp(slope.width_px / cell_px - 0.2, 0.1, 0.6);
    std::vector<cv::Point2d> found;
    for (std::size_t i = 0; i < edge.at_px.size(); ++i)
        if (const auto offset = edge_offset_px(slope, static_cast<int>(i), min_rise * slope.peak))
            found.push_back(edge.at_px[i] + *offset * edge.outward[i]);
    const auto straight = lens.undistort(found);
    if (!straight)
        return std::nullopt;
    std::vector<cv::Point2f> relative; // relative to `from`, so the precision of float suffices
    for (const cv::Point2d &point : *straight)
        relative.push_back(point - from);
    const double max_median_px = max_median_steps * slope.step_px;
    const double spacing_px =
        cv::norm(edge.at_px.back() - edge.at_px.front()) / static_cast<double>(edge.at_px.size() - 1);
    const double dependent = std::max<double>(slope.averaged, correlation_px / std::min(spacing_px, correlation_px));
    auto fitted = fit_line_robustly(relative, edge.at_px.size(), max_median_px, dependent);
    if (!fitted)
        fitted = fit_line_robustly(most_collinear(relative, max_median_px / 2), edge.at_px.size(), max_median_px,
                                   dependent);
    if (fitted) {
        fitted->line.point += from;
        fitted->blur_px = slope.blur_px();
    }
    return fitted;
}

// A rectangle around an edge, in undistorted pixels relative to a line beside it.
struct Surroundings {
    double first_px, last_px; // along the line
    double reach_px;          // on both sides of the line
};

// Returns the pixels in the surroundings of an edge, ordered by columns, or by rows if the edge is steep.
std::vector<EdgePixel> pixels_beside(const Picture &picture, const Edge &edge, const Line &line, cv::Point2d outward,
                                     double blur_px, const Surroundings &part, const Lens &lens) {
    const cv::Point2d along = edge.at_px.back() - edge.at_px.front();
    const bool is_steep = std::abs(along.y) > std::abs(along.x);
    const cv::Point step = is_steep ? cv::Point(1, 0) : cv::Point(0, 1);
    const int stride = std::max(static_cast<int>(blur_px / 2), 1); // resolves the blur
    std::vector<cv::Point2d> places; // three per column: the first pixel, the middle pixel and the last pixel
    int last = std::numeric_limits<int>::min();
    for (std::size_t i = 0; i < edge.at_px.size(); ++i) {
        if (!picture.contains(edge.at_px[i]))
            continue;
        const cv::Point middle(cvRound(edge.at_px[i].x), cvRound(edge.at_px[i].y));
        // Adds one px, because the middle is rounded and the line is not exactly at the position.
        const int half = static_cast<int>(part.reach_px / std::max(std::abs(edge.outward[i].dot(step)), 0.5) + 1.5);
        const int column = is_steep ? middle.y : middle.x;
        const cv::Rect inside({}, picture.grey.size());
        if (column == last || !inside.contains(middle - half * step) || !inside.contains(middle + half * step))
            continue;
        last = column;
        for (const int offset : {-half, 0, half})
            places.emplace_back(middle + offset * step);
    }
    const auto straight = lens.undistort(places);
    std::vector<EdgePixel> result;
    if (!straight)
        return result;
    for (std::size_t i = 0; i < places.size(); i += 3) {
        const cv::Point middle(places[i + 1]);
        const int half = cvRound((places[i + 2] - places[i + 1]).dot(step));
        // Over this short distance, a quadratic function approximates the distortion.
        const cv::Point2d constant = (*straight)[i + 1], linear = ((*straight)[i + 2] - (*straight)[i]) / (2 * half),
                          square = ((*straight)[i + 2] + (*straight)[i] - 2 * constant) / (2 * half * half);
        for (int k = -half; k <= half; k += stride) {
            const cv::Point2d place = constant - line.point + k * (linear + k * square);
            const double along_px = line.direction.dot(place), across_px = outward.dot(place);
            if (along_px >= part.first_px && along_px <= part.last_px && std::abs(across_px) <= part.reach_px)
                result.push_back({along_px, across_px,
                                  picture.light[picture.grey.at<std::uint8_t>(middle + k * step)],
                                  static_cast<int>(i / 3)});
        }
    }
    return result;
}

// Fits an edge to the pixels beside it. `line` is close to it, and `from` and `to` are the corners.
std::optional<FittedEdge> fit_pixels(const Picture &picture, Line line, cv::Point2d from, cv::Point2d to,
                                     double cell_px, double blur_px, const Lens &lens) {
    // Pixels beyond `useful_px` add little information. Within `pure_px`, cells beside the border and the margin
    // contribute little light.
    const double useful_px = 3.5 * blur_px, pure_px = cell_px - 2.5 * blur_px, needed_px = 1.6;
    const double reach_px = std::min(std::max(std::min(useful_px, pure_px), needed_px), 0.9 * cell_px);
    // The adjacent edges affect pixels up to this distance, and slightly farther if the camera sharpens.
    const double margin_px = std::min(3 * blur_px + 1, cv::norm(to - from) / 4);
    const auto edge = edge_between(from, to, lens, margin_px, count_of(from, to, 1));
    if (!edge)
        return std::nullopt;
    if (line.direction.dot(to - from) < 0)
        line.direction = -line.direction;
    const cv::Point2d outward(line.direction.y, -line.direction.x);
    const Surroundings part{line.direction.dot(from - line.point) + margin_px,
                            line.direction.dot(to - line.point) - margin_px, reach_px};
    const auto fitted = fit_blurred_edge(pixels_beside(picture, *edge, line, outward, blur_px, part, lens), blur_px);
    if (!fitted)
        return std::nullopt;
    const cv::Point2d direction = line.direction + fitted->turn * outward;
    return FittedEdge{{line.point + fitted->pivot_px * line.direction + fitted->offset_px * outward,
                       direction / cv::norm(direction)},
                      fitted->offset_variance,
                      fitted->turn_variance,
                      fitted->blur_px,
                      fitted->correlation};
}

// Returns the intersection of the line with the next line.
cv::Point2d crossing(const Line &line, const Line &next) {
    return line.point +
           (next.point - line.point).cross(next.direction) / line.direction.cross(next.direction) * line.direction;
}

// The black square in undistorted pixels.
struct Square {
    std::array<cv::Point2d, 4> rough, corners;
    double shortest_px;
    std::array<double, 4> cells_px; // the uniform part beside each edge: the border and the margin of the print

    Square(const std::vector<cv::Point2d> &rough_px, int cells)
        : rough{rough_px[0], rough_px[1], rough_px[2], rough_px[3]}, corners(rough),
          shortest_px(std::numeric_limits<double>::infinity()) {
        for (std::size_t i = 0; i < 4; ++i) {
            const cv::Point2d edge = next(i) - corners[i];
            const double length = cv::norm(edge);
            shortest_px = std::min(shortest_px, length);
            const auto height = [&](std::size_t other) {
                return std::abs(edge.cross(corners[other % 4] - corners[i])) / length;
            };
            cells_px[i] = std::min(height(i + 2), height(i + 3)) / cells;
        }
    }
    const cv::Point2d &next(std::size_t i) const { return corners[(i + 1) % 4]; }

    // Moves each corner to the intersection of its two lines. Returns the longest movement in px, or std::nullopt if
    // a corner is now far from its rough position.
    std::optional<double> move_to(const std::array<FittedEdge, 4> &edges) {
        double moved_px = 0;
        for (std::size_t i = 0; i < 4; ++i) {
            const cv::Point2d corner = crossing(edges[(i + 3) % 4].line, edges[i].line);
            moved_px = std::max(moved_px, cv::norm(corner - corners[i]));
            corners[i] = corner;
            if (!(cv::norm(corner - rough[i]) < shortest_px / 4)) // the comparison is false for NaN
                return std::nullopt;
        }
        return moved_px;
    }
};

// Implements refine_edges(). Searches each edge at up to `max_count` positions, then fits a line to the pixels. If
// the fit of an edge fails and `max_count` is below max_positions, returns std::nullopt. Otherwise keeps the line
// that the search found, and marks imprecise corners as doubtful.
std::optional<MeasuredCorners> refined(const Picture &picture, const Corners &rough_px, const Lens &lens, int cells,
                                       bool is_subpixel, std::size_t max_count, double &blur_cells) {
    constexpr int max_passes = 8, max_fits = 3;
    constexpr double max_sigma_px = 0.05, max_correlation = 0.5; // noise alone does not make corners doubtful
    constexpr double max_moved_px = 0.2;   // movement by the last fit, which uses the pixels near the previous line
    constexpr double sharp_step_px = 0.25; // suffices for a sharp edge
    constexpr double min_strength = 0.9;   // strength of the refined edges relative to the rough edges
    constexpr double max_noise = 0.12;     // relative to the peak; applies to tags too small to average out noise
    constexpr double max_blur = 0.7; // relative to the cell; a wider slope depends on the cells beside the border
    const auto rough = lens.undistort({rough_px.begin(), rough_px.end()});
    if (!rough)
        return std::nullopt;
    Square square(*rough, cells);
    const double cell_px = *std::ranges::min_element(square.cells_px), max_step_px = cell_px / reach;
    if (!(cell_px >= 1))
        return std::nullopt;
    const double min_step_px = std::min(sharp_step_px, max_step_px), converged_px = 0.8 * min_step_px;

    // +1 if the square is darker than its surroundings, otherwise −1
    double sign = 0, rough_strength = 0, strength = 0, margin_px = reach * min_step_px;
    bool is_unclear = false;
    std::array<FittedEdge, 4> fitted;
    for (int pass = 0; pass < max_passes; ++pass) {
        std::array<Edge, 4> edges;
        for (std::size_t i = 0; i < 4; ++i) {
            const std::size_t count = std::min(count_of(square.corners[i], square.next(i), 0.5), max_count);
            auto edge = edge_between(square.corners[i], square.next(i), lens, margin_px, count);
            if (!edge)
                return std::nullopt;
            edges[i] = std::move(*edge);
        }
        if (pass == 0) {
            double rise = 0;
            for (const Edge &edge : edges)
                rise += rise_across(picture, edge, reach * min_step_px);
            sign = rise < 0 ? -1 : 1;
        }
        strength = margin_px = 0;
        is_unclear = false;
        for (std::size_t i = 0; i < 4; ++i) {
            Slope slope = find_slope(picture, edges[i], min_step_px, max_step_px, sign);
            const auto edge = fit_edge(picture, edges[i], slope, square.cells_px[i], square.corners[i], lens);
            if (!edge)
                return std::nullopt;
            fitted[i] = *edge;
            blur_cells = std::max(i > 0 ? blur_cells : 0, edge->blur_px / square.cells_px[i]);
            strength += slope.on_line;
            margin_px = std::max(margin_px, reach * slope.step_px);
            const bool is_noisy = min_step_px < sharp_step_px && slope.noise > max_noise;
            const bool is_blurred = slope.step_px > min_step_px &&
                                    (slope.at_rim > contained * slope.peak || slope.width_px > max_blur * cell_px);
            is_unclear |= is_subpixel && (is_noisy || is_blurred);
        }
        if (pass == 0)
            rough_strength = strength;
        const auto moved_px = square.move_to(fitted);
        if (!moved_px)
            return std::nullopt;
        if (pass > 0 && *moved_px < converged_px)
            break;
    }
    if (is_unclear || strength < min_strength * rough_strength)
        return std::nullopt;
    bool is_misfit = true;
    for (int pass = 0; pass < max_fits && is_misfit; ++pass) {
        is_misfit = false;
        for (std::size_t i = 0; i < 4; ++i) {
            const auto edge = fit_pixels(picture, fitted[i].line, square.corners[i], square.next(i),
                                         square.cells_px[i], fitted[i].blur_px, lens);
            if (!edge && max_count < max_positions)
                return std::nullopt;
            if (edge)
                fitted[i] = *edge;
            is_misfit |= !edge;
        }
        const auto moved_px = square.move_to(fitted);
        if (!moved_px)
            return std::nullopt;
        is_misfit |= *moved_px >= max_moved_px;
    }
    if (is_misfit && max_count < max_positions)
        return std::nullopt;
    double variance = 0; // of a coordinate
    blur_cells = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        const FittedEdge &before = fitted[(i + 3) % 4], &after = fitted[i];
        // An error of one line moves the intersection along the other line.
        const double sine = before.line.direction.cross(after.line.direction);
        variance +=
            (before.variance_at(square.corners[i]) + after.variance_at(square.corners[i])) / (sine * sine) / (2 * 4);
        blur_cells = std::max(blur_cells, after.blur_px / square.cells_px[i]);
        is_misfit |= after.correlation > max_correlation;
    }
    const std::vector<cv::Point2d> corners(square.corners.begin(), square.corners.end());
    const auto distorted = lens.distort(corners);
    if (!distorted)
        return std::nullopt;
    const double sigma_px = std::sqrt(variance) * noise_scale(corners, *distorted);
    return MeasuredCorners{{(*distorted)[0], (*distorted)[1], (*distorted)[2], (*distorted)[3]},
                           std::isfinite(sigma_px) ? sigma_px : 0,
                           blur_cells,
                           is_misfit && sigma_px > max_sigma_px};
}

} // namespace

std::optional<MeasuredCorners> refine_edges(const cv::Mat &grey, arhost_transfer transfer, const Corners &rough_px,
                                            const Lens &lens, int cells, bool is_subpixel, double *blur_cells,
                                            double max_blur_cells) {
    const Picture picture{grey, light_of_code(transfer)};
    // A few positions suffice to locate the pixels for the fit, unless noise must be averaged out.
    double blur = 0;
    auto result = refined(picture, rough_px, lens, cells, is_subpixel, few_positions, blur);
    if (!result && !(blur > max_blur_cells))
        result = refined(picture, rough_px, lens, cells, is_subpixel, max_positions, blur);
    if (blur_cells)
        *blur_cells = blur;
    return result;
}

} // namespace arhost::fiducial
