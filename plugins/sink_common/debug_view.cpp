// SPDX-License-Identifier: Apache-2.0
#include "sink_common/debug_view.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string_view>

namespace arhost::drawing {
namespace {

constexpr std::size_t max_listed_targets = 16; // maximum number of targets in the box
constexpr double residual_scale = 50;

std::string name_of(const arhost_target &target) {
    return {target.name, ::strnlen(target.name, sizeof target.name)};
}

double distance_of(const arhost_target &target) {
    return std::hypot(target.mt[12], target.mt[13], target.mt[14]);
}

auto observations_of(const arhost_record &record, std::uint32_t first, std::uint32_t count) {
    return elements(record.observations, record.observation_count).part(first, count);
}

using Corners = double[4][2];

double longest_side_px(const Corners &corners) {
    double longest = 0;
    for (int i = 0; i < 4; ++i) {
        const double *from = corners[i], *to = corners[(i + 1) % 4];
        longest = std::max(longest, std::hypot(to[0] - from[0], to[1] - from[1]));
    }
    return longest;
}

Point centre_of(const Canvas &canvas, const arhost_observation &marker) {
    Point sum{0, 0};
    for (const auto &[x, y] : marker.corners_px)
        sum = {sum.x + x, sum.y + y};
    return canvas.at({sum.x / 4, sum.y / 4});
}

// Draws the outline, and a stroke that cuts off the first corner to mark it. The stroke connects the two sides that
// meet at this corner. Its end on the side to the second corner is farther from the first corner. Returns the lowest
// corner.
Point draw_quad(const Canvas &canvas, const Corners &corners_px, Colour colour) {
    Point corners[4];
    for (int i = 0; i < 4; ++i)
        corners[i] = canvas.at({corners_px[i][0], corners_px[i][1]});
    for (int i = 0; i < 4; ++i)
        canvas.line(corners[i], corners[(i + 1) % 4], colour);
    const auto towards = [&](int corner, double part) {
        return Point{corners[0].x + part * (corners[corner].x - corners[0].x),
                     corners[0].y + part * (corners[corner].y - corners[0].y)};
    };
    canvas.line(towards(1, 0.4), towards(3, 0.2), colour);
    return *std::ranges::max_element(corners, {}, &Point::y);
}

bool has_projection(const arhost_observation &marker) {
    return std::ranges::any_of(marker.projected_px,
                               [](const auto &corner) { return corner[0] != 0 || corner[1] != 0; });
}

// Draws magnified lines from the measured corners to the corners that the pose predicts. The lines are at most as
// long as the marker.
void draw_residuals(const Canvas &canvas, const arhost_observation &marker) {
    const double longest_px = longest_side_px(marker.corners_px);
    for (int i = 0; i < 4; ++i) {
        const double *from = marker.corners_px[i];
        const double x = marker.projected_px[i][0] - from[0], y = marker.projected_px[i][1] - from[1];
        const double scale = std::min(residual_scale, longest_px / std::hypot(x, y));
        canvas.line(canvas.at({from[0], from[1]}), canvas.at({from[0] + scale * x, from[1] + scale * y}), violet);
    }
}

// Draws text below a point, so that the text does not cover the picture there.
void write_below(const Canvas &canvas, Point point, const std::string &text, Colour colour) {
    canvas.label({point.x, point.y + canvas.text_height()}, text, colour);
}

Row row_of(const arhost_target &target) {
    if (target.state == ARHOST_TARGET_LOST)
        return {name_of(target), "lost for " + count_of(target.age_frames, "frame"), grey};
    std::string text = fmt::format("{}{:.0f} mm   error {:.2f} px   ambiguity {:.2f}",
                                   target.state == ARHOST_TARGET_PREDICTED ? "predicted   " : "", distance_of(target),
                                   target.reprojection_px, target.ambiguity);
    if (target.observation_count > 1)
        text += fmt::format("   {} markers", target.observation_count);
    return {name_of(target), text};
}

std::string search_text(const arhost_search &search) {
    std::string text =
        fmt::format("{}   {} expected", search.everywhere ? "whole frame" : "expected places", search.expected_count);
    if (search.missed_count > 0)
        text += fmt::format(", {} missed", search.missed_count);
    if (search.candidate_count >= 0)
        text += fmt::format("   {} of {} quadrilaterals read", search.observation_count, search.candidate_count);
    return text;
}

} // namespace

void DebugView::start(const arhost_sink_setup &setup) {
    width_ = setup.width;
    height_ = setup.height;
    if (setup.intrinsics) {
        lens_.emplace(*setup.intrinsics);
        focal_length_px_ = setup.intrinsics->fx;
    }
}

// Draws the axes of a target in the middle of the picture. `length_px`: length of an axis at that position. Returns
// the origin.
std::optional<Point> DebugView::draw_axes(const Canvas &canvas, const arhost_target &target, double length_px) const {
    const double length = length_px * distance_of(target) / focal_length_px_;
    // Returns the pixel of a point on an axis; columns 0 to 2 of `mt` are the axes. Eye space has y up and z
    // backward.
    const auto project = [&](int axis, double at) {
        const double *m = target.mt, *direction = m + 4 * axis;
        return lens_->project(
            {m[12] + at * direction[0], -(m[13] + at * direction[1]), -(m[14] + at * direction[2])});
    };
    const auto origin = project(0, 0);
    if (!origin)
        return std::nullopt;
    const Point from = canvas.at({origin->x, origin->y});
    for (int axis = 0; axis < 3; ++axis)
        if (const auto end = project(axis, length))
            canvas.line(from, canvas.at({end->x, end->y}), axis == 0 ? red : axis == 1 ? green : blue);
    return from;
}

void DebugView::draw_target(const Canvas &canvas, const arhost_record &record, const arhost_target &target) const {
    const Colour colour = target.state == ARHOST_TARGET_DETECTED ? yellow : grey;
    const auto markers = observations_of(record, target.first_observation, target.observation_count);
    double side_px = 0;
    std::optional<Point> lowest;
    for (const arhost_observation &marker : markers) {
        const Point corner = draw_quad(canvas, marker.corners_px, colour);
        if (markers.size() > 1)
            canvas.label(centre_of(canvas, marker), std::to_string(marker.id), colour);
        if (!lowest || corner.y > lowest->y)
            lowest = corner;
        side_px = std::max(side_px, longest_side_px(marker.corners_px));
    }
    if (lens_) {
        const auto origin = draw_axes(canvas, target, lowest ? side_px / 2 : height_ / 12);
        if (!lowest || markers.size() > 1)
            lowest = origin;
    }
    for (const arhost_observation &marker : markers)
        if (has_projection(marker))
            draw_residuals(canvas, marker);
    std::string text = name_of(target);
    if (markers.size() == 1 && !text.ends_with("-" + std::to_string(markers[0].id)))
        text += " " + std::to_string(markers[0].id);
    if (target.state == ARHOST_TARGET_PREDICTED)
        text += " predicted";
    if (lowest)
        write_below(canvas, *lowest, text, colour);
}

void DebugView::draw_expected(const Canvas &canvas, const arhost_expected_marker &expected, bool is_missed) const {
    double left = width_, top = height_, right = 0, bottom = 0;
    for (const auto &[x, y] : expected.corners_px) {
        left = std::min(left, x - expected.margin_px);
        right = std::max(right, x + expected.margin_px);
        top = std::min(top, y - expected.margin_px);
        bottom = std::max(bottom, y + expected.margin_px);
    }
    const Point first = canvas.at({std::max(left, 0.0), std::max(top, 0.0)}),
                last = canvas.at({std::min(right, width_ - 1), std::min(bottom, height_ - 1)});
    const Point corners[] = {first, {last.x, first.y}, last, {first.x, last.y}};
    for (int i = 0; i < 4; ++i)
        canvas.dashed_line(corners[i], corners[(i + 1) % 4], cyan);
    if (is_missed)
        draw_quad(canvas, expected.corners_px, grey);
}

double DebugView::draw(const Canvas &canvas, const arhost_record &record, const Timings &timings) const {
    std::vector<Row> rows = {
        {"frame", fmt::format("{}   {:.3f} s   {}", record.sequence, static_cast<double>(record.capture_ns) * 1e-9,
                              record.overlay == ARHOST_OVERLAY_RENDERED ? "overlay rendered"
                              : record.overlay == ARHOST_OVERLAY_HELD   ? "overlay held"
                                                                        : "no overlay")}};
    std::uint32_t expected_index = 0;
    for (const arhost_expected_marker &expected : elements(record.expected, record.expected_count))
        draw_expected(canvas, expected, expected_index++ + record.search.missed_count >= record.expected_count);
    std::uint32_t listed = 0; // the observations of targets come first
    for (const arhost_target &target : elements(record.targets, record.target_count)) {
        listed = std::max(listed, target.first_observation + target.observation_count);
        if (target.state != ARHOST_TARGET_LOST)
            draw_target(canvas, record, target);
        if (rows.size() <= max_listed_targets)
            rows.push_back(row_of(target));
    }
    if (record.target_count > max_listed_targets)
        rows.push_back(
            {"", fmt::format("and {}", count_of(record.target_count - max_listed_targets, "more target"))});
    const auto others = observations_of(record, listed, record.observation_count);
    for (const arhost_observation &marker : others) {
        const char *family = record.families[std::min<std::uint32_t>(marker.family, ARHOST_MAX_FAMILIES - 1)];
        write_below(canvas, draw_quad(canvas, marker.corners_px, pink),
                    fmt::format("{} {}", std::string_view(family, ::strnlen(family, ARHOST_MAX_FAMILY)), marker.id),
                    pink);
    }
    if (!others.empty())
        rows.push_back({"others", count_of(others.size(), "marker") + " that no target lists", pink});
    if (record.search.everywhere || record.search.expected_count > 0)
        rows.push_back({"search", search_text(record.search), cyan});
    if (std::ranges::any_of(elements(record.observations, record.observation_count), has_projection))
        rows.push_back({"residuals", fmt::format("magnified {:.0f} times", residual_scale), violet});
    for (const auto &[name, percentiles] : timings)
        rows.push_back({name, percentiles});
    return canvas.box(rows, 0, 0);
}

const arhost_output &DebugView::applied_to(const arhost_output &output) {
    if (!is_on)
        return output;
    output_ = output;
    output_.stride = 3 * output.width;
    bgr_.resize(std::size_t{output_.stride} * output.height);
    for (std::size_t y = 0; y < output.height; ++y)
        std::copy_n(output.bgr + y * output.stride, output_.stride, bgr_.data() + y * output_.stride);
    draw(PictureCanvas(bgr_.data(), output_.stride, output.width, output.height), *output.record);
    output_.bgr = bgr_.data();
    return output_;
}

} // namespace arhost::drawing
