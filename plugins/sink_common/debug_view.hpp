// SPDX-License-Identifier: Apache-2.0
//
// Draws the measurements of the tracker into the picture (docs/tracking.md).
#pragma once

#include "sink_common/canvas.hpp"

#include <arhost-cpp/plugin.hpp>
#include <arhost/shading/lens.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace arhost::drawing {

using Timings = std::vector<std::pair<std::string, std::string>>; // name of a stage or output, percentiles

inline std::string count_of(std::int64_t number, const std::string &noun) {
    return std::to_string(number) + " " + noun + (number == 1 ? "" : "s");
}

class DebugView {
public:
    static constexpr const char *key = "debug_view";
    static constexpr arhost_option_descriptor option =
        arhost::option(ARHOST_OPTION_BOOL, key, "false", "Draw the measurements of the tracker (docs/tracking.md).");

    explicit DebugView(const Options &options) : is_on(options.boolean(key)) {}
    void start(const arhost_sink_setup &setup);

    // Draws the measurements, and a box with numbers and stage times at the top. Returns the height of the box in px.
    // Draws the outlines of the markers, their expected positions and their residuals. Draws the names and states of
    // the targets and, if the lens is known, their axes (x red, y green, z blue).
    double draw(const Canvas &canvas, const arhost_record &record, const Timings &timings = {}) const;

    // If the view is on, returns the output with the view drawn into its picture; otherwise returns `output`. The
    // result is valid until the next call.
    const arhost_output &applied_to(const arhost_output &output);

    bool is_on;

private:
    void draw_target(const Canvas &canvas, const arhost_record &record, const arhost_target &target) const;
    std::optional<Point> draw_axes(const Canvas &canvas, const arhost_target &target, double length_px) const;
    void draw_expected(const Canvas &canvas, const arhost_expected_marker &expected, bool is_missed) const;

    double width_ = 0, height_ = 0; // size of the frame, px
    std::optional<shading::Lens> lens_;
    double focal_length_px_ = 0;
    std::vector<std::uint8_t> bgr_;
    arhost_output output_{}; // a copy of the output with the picture `bgr_`
};

} // namespace arhost::drawing
