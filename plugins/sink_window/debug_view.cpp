// SPDX-License-Identifier: Apache-2.0
#include "debug_view.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

namespace sink_window {
namespace {

using arhost::shading::Lens;

double distance_of(const arhost_marker &marker) {
    return std::hypot(marker.mt[12], marker.mt[13], marker.mt[14]);
}

// Draws the axes as long as half of the marker's side. The record does not contain the side, but its length in pixels
// and its distance.
void draw_axes(const Overlay &overlay, const View &view, const arhost_marker &marker, const Lens &lens,
               double focal_length_px) {
    double side_px = 0;
    for (int i = 0; i < 4; ++i) {
        const double *from = marker.corners_px[i], *to = marker.corners_px[(i + 1) % 4];
        side_px = std::max(side_px, std::hypot(to[0] - from[0], to[1] - from[1]));
    }
    const double length = side_px * distance_of(marker) / focal_length_px / 2;
    // Returns the pixel of a point on an axis; columns 0 to 2 of `mt` are the axes. Eye space has y up and z
    // backward.
    const auto project = [&](int axis, double at) {
        const double *m = marker.mt, *direction = m + 4 * axis;
        return lens.project({m[12] + at * direction[0], -(m[13] + at * direction[1]), -(m[14] + at * direction[2])});
    };
    const auto origin = project(0, 0);
    for (int axis = 0; origin && axis < 3; ++axis)
        if (const auto end = project(axis, length))
            overlay.line(view.to_window({origin->x, origin->y}), view.to_window({end->x, end->y}),
                         axis == 0   ? red
                         : axis == 1 ? green
                                     : blue);
}

void draw_marker(const Overlay &overlay, const View &view, const arhost_marker &marker, const Lens *lens,
                 double focal_length_px) {
    Point corners[4];
    for (int i = 0; i < 4; ++i)
        corners[i] = view.to_window({marker.corners_px[i][0], marker.corners_px[i][1]});
    for (int i = 0; i < 4; ++i)
        overlay.line(corners[i], corners[(i + 1) % 4], marker.state == ARHOST_MARKER_DETECTED ? yellow : grey);
    if (lens)
        draw_axes(overlay, view, marker, *lens, focal_length_px);
    // Below the lowest corner, so that it does not cover the marker.
    const Point &lowest = *std::ranges::max_element(corners, {}, &Point::y);
    overlay.label({lowest.x, lowest.y + overlay.text_height()}, std::to_string(marker.id), yellow);
}

} // namespace

double draw_debug_view(const Overlay &overlay, const View &view, const arhost_record &record, const Lens *lens,
                       double focal_length_px, const Timings &timings) {
    std::vector<Row> rows = {
        {"frame", fmt::format("{}   {:.3f} s   {}", record.sequence, static_cast<double>(record.capture_ns) * 1e-9,
                              record.overlay == ARHOST_OVERLAY_RENDERED ? "overlay rendered"
                              : record.overlay == ARHOST_OVERLAY_HELD   ? "overlay held"
                                                                        : "no overlay")}};
    for (const arhost_marker &marker : std::span(record.markers, record.marker_count)) {
        if (marker.state == ARHOST_MARKER_LOST) {
            rows.push_back({std::to_string(marker.id), "lost", grey});
            continue;
        }
        draw_marker(overlay, view, marker, lens, focal_length_px);
        rows.push_back(
            {std::to_string(marker.id), fmt::format("{}{:.0f} mm   error {:.2f} px   ambiguity {:.2f}",
                                                    marker.state == ARHOST_MARKER_PREDICTED ? "predicted   " : "",
                                                    distance_of(marker), marker.reprojection_px, marker.ambiguity)});
    }
    for (const auto &[name, percentiles] : timings)
        rows.push_back({name, percentiles});
    return overlay.box(rows, 0, 0);
}

} // namespace sink_window
