// SPDX-License-Identifier: Apache-2.0
#include "sink_common/record_line.hpp"

#include "sink_common/json_text.hpp"

#include <algorithm>
#include <cstring>
#include <span>

namespace arhost::record {
namespace {

using json_text::append;
using json_text::append_number;

// Appends a JSON string and replaces all bytes that are not printable ASCII with '?'. Family names are ASCII; other
// bytes can only come from a defective tracker.
void append_text(std::string &text, std::string_view value) {
    text += '"';
    for (const char c : value) {
        if (c == '"' || c == '\\')
            text += '\\';
        text += c >= ' ' && c <= '~' ? c : '?';
    }
    text += '"';
}

const char *name_of_state(arhost_marker_state state) {
    switch (state) {
    case ARHOST_MARKER_DETECTED:
        return "detected";
    case ARHOST_MARKER_PREDICTED:
        return "predicted";
    default:
        return "lost";
    }
}

const char *name_of_overlay(arhost_overlay overlay) {
    switch (overlay) {
    case ARHOST_OVERLAY_RENDERED:
        return "rendered";
    case ARHOST_OVERLAY_HELD:
        return "held";
    default:
        return "none";
    }
}

void append(std::string &text, const arhost_marker &marker) {
    text += "{\"family\": ";
    append_text(text, {marker.family, ::strnlen(marker.family, sizeof marker.family)});
    text += ", \"id\": ";
    append_number(text, marker.id);
    text += ", \"state\": \"";
    text += name_of_state(marker.state);
    text += "\", \"age_frames\": ";
    append_number(text, marker.age_frames);
    text += ", \"corners_px\": [";
    for (std::size_t i = 0; i < 4; ++i) {
        text += i > 0 ? ", " : "";
        append(text, std::span(marker.corners_px[i]));
    }
    text += "], \"mt\": ";
    append(text, std::span(marker.mt));
    if (!std::ranges::all_of(marker.mt_alternative, [](double x) { return x == 0; })) {
        text += ", \"mt_alternative\": ";
        append(text, std::span(marker.mt_alternative));
    }
    text += ", \"reprojection_px\": ";
    append(text, marker.reprojection_px);
    text += ", \"ambiguity\": ";
    append(text, marker.ambiguity);
    text += '}';
}

void append(std::string &text, const arhost_camera &camera) {
    text += "{\"eye\": ";
    append(text, std::span(camera.eye));
    text += ", \"look_at\": ";
    append(text, std::span(camera.look_at));
    text += ", \"up\": ";
    append(text, std::span(camera.up));
    text += '}';
}

} // namespace

void append_members(std::string &text, const arhost_record &record) {
    text += json_text::frame_start;
    append_number(text, record.sequence);
    text += ", \"capture_ns\": ";
    append_number(text, record.capture_ns);
    text += ", \"clock\": \"";
    text += record.clock == ARHOST_CLOCK_MONOTONIC ? "monotonic" : "media";
    text += "\", \"overlay\": \"";
    text += name_of_overlay(record.overlay);
    text += "\", ";
    if (record.overlay_scale > 0) {
        text += "\"overlay_scale\": ";
        append(text, record.overlay_scale);
        text += ", ";
    }
    if (record.overlay_samples > 0) {
        text += "\"overlay_samples\": ";
        append_number(text, record.overlay_samples);
        text += ", ";
    }
    text += "\"markers\": [";
    const std::uint32_t markers = std::min<std::uint32_t>(record.marker_count, ARHOST_MAX_MARKERS);
    for (std::uint32_t i = 0; i < markers; ++i) {
        text += i > 0 ? ", " : "";
        append(text, record.markers[i]);
    }
    text += "], \"camera\": ";
    if (record.has_camera)
        append(text, record.camera);
    else
        text += "null";
    if (record.has_truth) {
        text += ", \"truth\": {\"id\": ";
        append_number(text, record.truth_id);
        text += ", \"mt\": ";
        append(text, std::span(record.true_mt));
        text += '}';
    }
}

void append_line(std::string &text, const arhost_record &record) {
    append_members(text, record);
    text += "}\n";
}

} // namespace arhost::record
