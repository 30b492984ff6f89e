// SPDX-License-Identifier: Apache-2.0
#include "debug_view.hpp"

#include <arhost-cpp/plugin.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>

namespace sink_window {
namespace {

using arhost::shading::Lens;

constexpr std::size_t max_listed_targets = 16; // in the box

std::string name_of(const arhost_target &target) {
    return {target.name, ::strnlen(target.name, sizeof target.name)};
}

double distance_of(const arhost_target &target) {
    return std::hypot(target.mt[12], target.mt[13], target.mt[14]);
}

auto observations_of(const arhost_record &record, std::uint32_t first, std::uint32_t count) {
    return arhost::elements(record.observations, record.observation_count).part(first, count);
}

// Draws the outline and a stroke that cuts the first corner and reaches further along the edge to the second one.
// Returns the lowest corner.
Point draw_marker(const Overlay &overlay, const View &view, const arhost_observation &marker, Colour colour) {
    Point corners[4];
    for (int i = 0; i < 4; ++i)
        corners[i] = view.to_window({marker.corners_px[i][0], marker.corners_px[i][1]});
    for (int i = 0; i < 4; ++i)
        overlay.line(corners[i], corners[(i + 1) % 4], colour);
    const auto towards = [&](int corner, double part) {
        return Point{corners[0].x + part * (corners[corner].x - corners[0].x),
                     corners[0].y + part * (corners[corner].y - corners[0].y)};
    };
    overlay.line(towards(1, 0.4), towards(3, 0.2), colour);
    return *std::ranges::max_element(corners, {}, &Point::y);
}

// Writes below a point, so that the text does not cover what is there.
void write_below(const Overlay &overlay, Point point, const std::string &text, Colour colour) {
    overlay.label({point.x, point.y + overlay.text_height()}, text, colour);
}

double longest_side_px(const arhost_observation &marker) {
    double longest = 0;
    for (int i = 0; i < 4; ++i) {
        const double *from = marker.corners_px[i], *to = marker.corners_px[(i + 1) % 4];
        longest = std::max(longest, std::hypot(to[0] - from[0], to[1] - from[1]));
    }
    return longest;
}

// Draws axes of this length, for a target in the middle of the picture. Returns the origin.
std::optional<Point> draw_axes(const Overlay &overlay, const View &view, const arhost_target &target,
                               const Lens &lens, double focal_length_px, double length_px) {
    const double length = length_px * distance_of(target) / focal_length_px;
    // Returns the pixel of a point on an axis; columns 0 to 2 of `mt` are the axes. Eye space has y up and z
    // backward.
    const auto project = [&](int axis, double at) {
        const double *m = target.mt, *direction = m + 4 * axis;
        return lens.project({m[12] + at * direction[0], -(m[13] + at * direction[1]), -(m[14] + at * direction[2])});
    };
    const auto origin = project(0, 0);
    if (!origin)
        return std::nullopt;
    const Point from = view.to_window({origin->x, origin->y});
    for (int axis = 0; axis < 3; ++axis)
        if (const auto end = project(axis, length))
            overlay.line(from, view.to_window({end->x, end->y}), axis == 0 ? red : axis == 1 ? green : blue);
    return from;
}

void draw_target(const Overlay &overlay, const View &view, const arhost_record &record, const arhost_target &target,
                 const Lens *lens, double focal_length_px) {
    const Colour colour = target.state == ARHOST_TARGET_DETECTED ? yellow : grey;
    double side_px = 0;
    std::optional<Point> lowest;
    for (const arhost_observation &marker :
         observations_of(record, target.first_observation, target.observation_count)) {
        const Point corner = draw_marker(overlay, view, marker, colour);
        if (!lowest || corner.y > lowest->y)
            lowest = corner;
        side_px = std::max(side_px, longest_side_px(marker));
    }
    if (lens) {
        const double length_px = lowest ? side_px / 2 : view.height / 12.0;
        const auto origin = draw_axes(overlay, view, target, *lens, focal_length_px, length_px);
        if (!lowest)
            lowest = origin;
    }
    if (lowest)
        write_below(overlay, *lowest, name_of(target) + (target.state == ARHOST_TARGET_PREDICTED ? " predicted" : ""),
                    colour);
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

} // namespace

double draw_debug_view(const Overlay &overlay, const View &view, const arhost_record &record, const Lens *lens,
                       double focal_length_px, const Timings &timings) {
    std::vector<Row> rows = {
        {"frame", fmt::format("{}   {:.3f} s   {}", record.sequence, static_cast<double>(record.capture_ns) * 1e-9,
                              record.overlay == ARHOST_OVERLAY_RENDERED ? "overlay rendered"
                              : record.overlay == ARHOST_OVERLAY_HELD   ? "overlay held"
                                                                        : "no overlay")}};
    std::uint32_t listed = 0; // the observations of targets come first
    for (const arhost_target &target : arhost::elements(record.targets, record.target_count)) {
        listed = std::max(listed, target.first_observation + target.observation_count);
        if (target.state != ARHOST_TARGET_LOST)
            draw_target(overlay, view, record, target, lens, focal_length_px);
        if (rows.size() <= max_listed_targets)
            rows.push_back(row_of(target));
    }
    if (record.target_count > max_listed_targets)
        rows.push_back(
            {"", fmt::format("and {}", count_of(record.target_count - max_listed_targets, "more target"))});
    const auto others = observations_of(record, listed, record.observation_count);
    for (const arhost_observation &marker : others) {
        const char *family = record.families[std::min<std::uint32_t>(marker.family, ARHOST_MAX_FAMILIES - 1)];
        write_below(overlay, draw_marker(overlay, view, marker, pink),
                    fmt::format("{} {}", std::string_view(family, ::strnlen(family, ARHOST_MAX_FAMILY)), marker.id),
                    pink);
    }
    if (!others.empty())
        rows.push_back({"others", count_of(others.size(), "marker") + " that no target lists", pink});
    for (const auto &[name, percentiles] : timings)
        rows.push_back({name, percentiles});
    return overlay.box(rows, 0, 0);
}

} // namespace sink_window
