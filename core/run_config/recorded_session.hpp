// SPDX-License-Identifier: Apache-2.0
//
// Reads the sessions that the plugin sink_session records (docs/sessions.md).
#pragma once

#include "camera/trajectory.hpp"
#include "yaml/yaml.hpp"

#include <arhost/sink.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace arhost::run_config {

// The member `version` of session.json. Logs of version 1 have markers instead of targets.
constexpr int session_version = 2;

// The record of a frame in a session's log: data that the video does not contain, and the decisions of the recorded
// run.
struct RecordedFrame {
    std::uint64_t number; // in the recorded run; frames that it dropped are missing
    std::int64_t capture_ns;
    arhost_clock clock;
    arhost_overlay overlay;
    double scale;          // quality of the overlay, as in host::Quality
    std::uint32_t samples; // likewise
    std::vector<arhost_target> targets;
    std::vector<arhost_observation> observations; // of the targets
    arhost_search search{};
    std::optional<camera::View> view;
    std::optional<std::pair<std::string, std::array<double, 16>>> truth; // truth_target and true_mt of arhost_record
};

// The frames of a session that a run repeats. Frame i of the source is frames[i].
struct Recording {
    std::vector<RecordedFrame> frames;
    // Whether frames have the recorded poses, and an overlay exactly where the recorded run has one. Otherwise every
    // frame is tracked and rendered as in any other run.
    bool repeats_decisions = true;
};

struct Session {
    std::filesystem::path folder;
    yaml::Node description;   // session.json
    yaml::Node configuration; // configuration.yaml, with the paths of the recorded run
    Recording recording;
    std::string warning; // what is missing at the end, as a message for the user; ""

    std::filesystem::path video() const { return folder / "video.mkv"; }
    // Describes the scene files that have changed since the recording, one message each.
    std::vector<std::string> changed_scene_files() const;
};

// Reads a session. Frames at the end that the video or the log does not have completely are left out, with a warning.
// Throws yaml::Error, whose message names file and line, for anything else that is missing or damaged.
Session read_session(const std::filesystem::path &folder);

// Size and hash (64-bit FNV-1a, hexadecimal) of a regular file. The hash of larger files is "". Returns
// nullopt if the file cannot be read.
struct Fingerprint {
    std::uint64_t bytes;
    std::string hash;
    bool operator==(const Fingerprint &) const = default;
};
std::optional<Fingerprint> fingerprint_of(const std::filesystem::path &file, std::uint64_t max_hashed_bytes);

} // namespace arhost::run_config
