// SPDX-License-Identifier: Apache-2.0
#include "edge_refinement.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace arhost::fiducial {
namespace {

struct Line {
    cv::Point2d point, direction;
};

double sample(const cv::Mat &grey, cv::Point2d at) {
    const double x = std::floor(at.x), y = std::floor(at.y);
    if (!(x >= 0 && y >= 0 && x + 1 < grey.cols && y + 1 < grey.rows))
        return std::numeric_limits<double>::quiet_NaN();
    const double a = at.x - x, b = at.y - y;
    const std::uint8_t *upper = grey.ptr(static_cast<int>(y)) + static_cast<int>(x);
    const std::uint8_t *lower = upper + grey.step;
    return (1 - b) * ((1 - a) * upper[0] + a * upper[1]) + b * ((1 - a) * lower[0] + a * lower[1]);
}

// Returns the offset of the edge from `at` along the outward normal: the mean position weighted by the squared
// gradient, as in AprilTag. Only uses gradients of the sign `sign`. Returns std::nullopt if none of them exceeds the
// noise.
std::optional<double> edge_offset_px(const cv::Mat &grey, cv::Point2d at, cv::Point2d outward, double sign) {
    constexpr double step = 0.25, min_rise = 8;                                 // step in px; min_rise in grey levels
    constexpr int search = 9, half_baseline = 3, ends = search + half_baseline; // all in steps
    std::array<double, 2 * ends + 1> profile;
    for (int i = -ends; i <= ends; ++i)
        profile[i + ends] = sample(grey, at + i * step * outward);
    double weighted = 0, weights = 0;
    for (int i = -search; i <= search; ++i) {
        const double rise = sign * (profile[i + half_baseline + ends] - profile[i - half_baseline + ends]);
        if (rise > min_rise) { // also false if `rise` is NaN
            weighted += rise * rise * i;
            weights += rise * rise;
        }
    }
    return weights > 0 ? std::optional(weighted / weights * step) : std::nullopt;
}

Line fit_line(const std::vector<cv::Point2f> &points) {
    cv::Vec4f line;
    cv::fitLine(points, line, cv::DIST_L2, 0, 0, 0);
    return {cv::Point2d(line[2], line[3]), cv::Point2d(line[0], line[1])};
}

// Fits a line without outliers. `sampled` is the number of positions at which an edge was searched. Returns
// std::nullopt if fewer than half of them remain.
std::optional<Line> fit_line_robustly(std::vector<cv::Point2f> points, std::size_t sampled) {
    constexpr double min_inlier_px = 0.3;
    for (int round = 0;; ++round) {
        if (points.size() < std::max<std::size_t>(sampled / 2, 2))
            return std::nullopt;
        const Line line = fit_line(points);
        std::vector<double> residuals;
        residuals.reserve(points.size());
        for (const cv::Point2f &point : points)
            residuals.push_back(std::abs(line.direction.cross(cv::Point2d(point) - line.point)));
        std::vector<double> sorted = residuals;
        const auto median = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
        std::nth_element(sorted.begin(), median, sorted.end());
        const double bound = std::max(min_inlier_px, 2.5 * *median);
        std::vector<cv::Point2f> kept;
        for (std::size_t i = 0; i < points.size(); ++i)
            if (residuals[i] <= bound)
                kept.push_back(points[i]);
        if (kept.size() == points.size() || round == 5)
            return *median < 1 ? std::optional(line) : std::nullopt;
        points = std::move(kept);
    }
}

// Fits a line in undistorted pixels to the edge between two corners.
std::optional<Line> fit_edge(const cv::Mat &grey, cv::Point2d from, cv::Point2d to, const Lens &lens, double sign) {
    const double length = cv::norm(to - from);
    // Close to a corner, the search would hit the adjacent edge.
    const double margin = std::min(3.0, length / 4) / length;
    const std::size_t count = std::clamp<std::size_t>(static_cast<std::size_t>(length / 2), 16, 100);
    std::vector<cv::Point2d> samples;
    for (std::size_t i = 0; i < count; ++i)
        samples.push_back(from + (margin + (1 - 2 * margin) * static_cast<double>(i) / (count - 1)) * (to - from));
    samples = lens.distort(samples);
    std::vector<cv::Point2d> found;
    for (std::size_t i = 0; i < count; ++i) {
        const cv::Point2d along = samples[std::min(i + 1, count - 1)] - samples[i > 0 ? i - 1 : 0];
        // The corners are in clockwise order.
        const cv::Point2d outward = cv::Point2d(along.y, -along.x) / cv::norm(along);
        if (const auto offset = edge_offset_px(grey, samples[i], outward, sign))
            found.push_back(samples[i] + *offset * outward);
    }
    const auto straight = lens.undistort(found);
    if (!straight)
        return std::nullopt;
    std::vector<cv::Point2f> relative; // relative to `from`, so the precision of float suffices
    for (const cv::Point2d &point : *straight)
        relative.push_back(point - from);
    auto line = fit_line_robustly(std::move(relative), count);
    if (line)
        line->point += from;
    return line;
}

// Returns +1 if the square is darker than its surroundings, otherwise −1.
double contrast_sign(const cv::Mat &grey, const Corners &corners) {
    const cv::Point2d centre = 0.25 * (corners[0] + corners[1] + corners[2] + corners[3]);
    double sum = 0;
    for (int i = 0; i < 4; ++i) {
        const cv::Point2d middle = 0.5 * (corners[i] + corners[(i + 1) % 4]);
        const cv::Point2d outward = (middle - centre) / cv::norm(middle - centre);
        const double rise = sample(grey, middle + 2 * outward) - sample(grey, middle - 2 * outward);
        sum += std::isfinite(rise) ? rise : 0;
    }
    return sum < 0 ? -1 : 1;
}

} // namespace

std::optional<Corners> refine_edges(const cv::Mat &grey, const Corners &rough_px, const Lens &lens) {
    constexpr int max_passes = 8;
    constexpr double converged_px = 0.2;
    const double sign = contrast_sign(grey, rough_px);
    const auto rough = lens.undistort({rough_px.begin(), rough_px.end()});
    if (!rough)
        return std::nullopt;
    std::vector<cv::Point2d> corners = *rough;
    double shortest = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 4; ++i)
        shortest = std::min(shortest, cv::norm(corners[(i + 1) % 4] - corners[i]));

    double moved = converged_px;
    for (int pass = 0; pass < max_passes && moved >= converged_px; ++pass) {
        std::array<Line, 4> lines;
        for (int i = 0; i < 4; ++i) {
            const auto line = fit_edge(grey, corners[i], corners[(i + 1) % 4], lens, sign);
            if (!line)
                return std::nullopt;
            lines[i] = *line;
        }
        moved = 0;
        for (int i = 0; i < 4; ++i) {
            const Line &before = lines[(i + 3) % 4], &after = lines[i];
            const cv::Point2d crossing = before.point + (after.point - before.point).cross(after.direction) /
                                                            before.direction.cross(after.direction) *
                                                            before.direction;
            moved = std::max(moved, cv::norm(crossing - corners[i]));
            corners[i] = crossing;
            if (!(cv::norm(crossing - (*rough)[i]) < shortest / 4)) // the comparison is false for NaN
                return std::nullopt;
        }
    }
    const std::vector<cv::Point2d> distorted = lens.distort(corners);
    return Corners{distorted[0], distorted[1], distorted[2], distorted[3]};
}

} // namespace arhost::fiducial
