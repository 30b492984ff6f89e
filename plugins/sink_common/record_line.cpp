// SPDX-License-Identifier: Apache-2.0
#include "sink_common/record_line.hpp"

#include "sink_common/json_text.hpp"

#include <arhost-cpp/plugin.hpp>

#include <algorithm>
#include <cstring>
#include <span>
#include <string_view>
#include <utility>

namespace arhost::record {
namespace {

using json_text::append;
using json_text::append_number;

// Appends a JSON string. Replaces all bytes that are not printable ASCII with '?'. The host's names are ASCII, so
// other bytes come from a defective host.
template <std::size_t size> void append_text(std::string &text, const char (&value)[size]) {
    text += '"';
    for (const char c : std::string_view(value, ::strnlen(value, size))) {
        if (c == '"' || c == '\\')
            text += '\\';
        text += c >= ' ' && c <= '~' ? c : '?';
    }
    text += '"';
}

const char *name_of_state(arhost_target_state state) {
    switch (state) {
    case ARHOST_TARGET_DETECTED:
        return "detected";
    case ARHOST_TARGET_PREDICTED:
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

// Appends an array unless all its elements are 0, which means "unknown".
void append_if_known(std::string &text, const char *key, std::span<const double> numbers) {
    if (std::ranges::all_of(numbers, [](double x) { return x == 0; }))
        return;
    text += key;
    append(text, numbers);
}

void append(std::string &text, const arhost_observation &observation) {
    text += "{\"id\": ";
    append_number(text, observation.id);
    text += ", \"corners_px\": [";
    for (std::size_t i = 0; i < 4; ++i) {
        text += i > 0 ? ", " : "";
        append(text, std::span(observation.corners_px[i]));
    }
    text += "], \"decision_margin\": ";
    append(text, observation.decision_margin);
    text += ", \"corner_sigma_px\": ";
    append(text, observation.corner_sigma_px);
    text += ", \"hamming\": ";
    append_number(text, observation.hamming);
    text += '}';
}

void append(std::string &text, const arhost_target &target, const arhost_record &record) {
    text += "{\"name\": ";
    append_text(text, target.name);
    text += ", \"state\": \"";
    text += name_of_state(target.state);
    text += "\", \"age_frames\": ";
    append_number(text, target.age_frames);
    text += ", \"mt\": ";
    append(text, std::span(target.mt));
    if (target.state == ARHOST_TARGET_DETECTED || target.state == ARHOST_TARGET_PREDICTED) {
        append_if_known(text, ", \"mt_alternative\": ", target.mt_alternative);
        append_if_known(text, ", \"covariance\": ", target.covariance);
        text += ", \"reprojection_px\": ";
        append(text, target.reprojection_px);
        text += ", \"ambiguity\": ";
        append(text, target.ambiguity);
        text += ", \"observations\": [";
        const char *separator = "";
        for (const arhost_observation &observation : arhost::elements(record.observations, record.observation_count)
                                                         .part(target.first_observation, target.observation_count)) {
            text += std::exchange(separator, ", ");
            append(text, observation);
        }
        text += ']';
    }
    text += '}';
}

void append(std::string &text, const arhost_search &search) {
    if (!search.everywhere && search.expected_count == 0) // the tracker has not processed the frame
        return;
    text += "\"search\": {\"everywhere\": ";
    text += search.everywhere ? "true" : "false";
    for (const auto &[key, count] : {std::pair{"observations", search.observation_count},
                                     {"unlisted", search.unlisted_count},
                                     {"expected", search.expected_count},
                                     {"missed", search.missed_count}}) {
        text += std::string(", \"") + key + "\": ";
        append_number(text, count);
    }
    text += ", \"candidates\": ";
    if (search.candidate_count >= 0)
        append_number(text, search.candidate_count);
    else
        text += "null";
    text += "}, ";
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
    if (record.overlay_shading_px > 0) {
        text += "\"overlay_shading_px\": ";
        append_number(text, record.overlay_shading_px);
        text += ", ";
    }
    text += "\"targets\": [";
    const char *separator = "";
    for (const arhost_target &target : arhost::elements(record.targets, record.target_count)) {
        text += separator;
        append(text, target, record);
        separator = ", ";
    }
    text += "], ";
    append(text, record.search);
    text += "\"camera\": ";
    if (record.has_camera)
        append(text, record.camera);
    else
        text += "null";
    if (record.has_truth) {
        text += ", \"truth\": {\"target\": ";
        append_text(text, record.truth_target);
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
