// SPDX-License-Identifier: Apache-2.0
#include "lines.hpp"

#include "sink_common/json_text.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace arhost::trajectory {
namespace {

using json_text::append;
using json_text::append_number;

const char *name_of(arhost_distortion distortion) {
    switch (distortion) {
    case ARHOST_DISTORTION_BROWN:
        return "brown";
    case ARHOST_DISTORTION_FISHEYE:
        return "fisheye";
    default:
        return "none";
    }
}

// Returns whether the record has a camera with finite numbers. A defective host could send non-finite numbers.
bool has_camera(const arhost_record &record) {
    const auto finite = [](const double(&values)[3]) {
        return std::ranges::all_of(values, [](double value) { return std::isfinite(value); });
    };
    return record.has_camera && finite(record.camera.eye) && finite(record.camera.look_at) &&
           finite(record.camera.up);
}

void append_vector(std::string &text, const char *key, const double (&values)[3], bool is_set) {
    text += key;
    if (is_set)
        append(text, std::span(values));
    else
        text += "null";
}

} // namespace

void append_header(std::string &text, const arhost_intrinsics &intrinsics, arhost_clock clock, double fps) {
    text += R"({"format": "arhost-trajectory", "version": 1, "unit": "mm", "clock": ")";
    text += clock == ARHOST_CLOCK_MONOTONIC ? "monotonic" : "media";
    text += R"(", "fps": )";
    append(text, std::isfinite(fps) ? fps : 0.0);
    text += R"(, "camera": {"width": )";
    append_number(text, intrinsics.width);
    text += R"(, "height": )";
    append_number(text, intrinsics.height);
    for (const auto &[key, value] : {std::pair{R"(, "fx": )", intrinsics.fx},
                                     {R"(, "fy": )", intrinsics.fy},
                                     {R"(, "cx": )", intrinsics.cx},
                                     {R"(, "cy": )", intrinsics.cy}}) {
        text += key;
        append(text, value);
    }
    text += R"(, "distortion": {"model": ")";
    text += name_of(intrinsics.distortion);
    text += R"(", "coefficients": )";
    append(text, std::span(intrinsics.coefficients,
                           std::min<std::size_t>(intrinsics.coefficient_count, ARHOST_MAX_DISTORTION)));
    text += "}}}\n";
}

void append_frame(std::string &text, const arhost_record &record) {
    const bool is_set = has_camera(record);
    text += json_text::frame_start;
    append_number(text, record.sequence);
    text += R"(, "capture_ns": )";
    append_number(text, record.capture_ns);
    append_vector(text, R"(, "eye": )", record.camera.eye, is_set);
    append_vector(text, R"(, "look_at": )", record.camera.look_at, is_set);
    append_vector(text, R"(, "up": )", record.camera.up, is_set);
    text += "}\n";
}

void append_dissertation_frame(std::string &text, const arhost_record &record) {
    if (has_camera(record))
        for (const auto *values : {&record.camera.eye, &record.camera.look_at, &record.camera.up})
            for (const double value : *values) {
                char digits[32];
                text.append(digits,
                            std::to_chars(digits, digits + sizeof digits, value, std::chars_format::general, 6).ptr);
                text += ' ';
            }
    text += '\n';
}

} // namespace arhost::trajectory
