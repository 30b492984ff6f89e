// SPDX-License-Identifier: Apache-2.0
//
// Reads the sessions that the plugin sink_session records (docs/sessions.md).
#pragma once

#include "base/limits.hpp"
#include "run_config/recording.hpp"
#include "sandbox/sandbox.hpp"
#include "supervise/process.hpp"
#include "yaml/yaml.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace arhost::cli {

struct Session {
    std::filesystem::path folder;
    yaml::Node description;          // session.json
    yaml::Node configuration;        // configuration.yaml, with the paths of the recorded run
    run_config::Recording recording; // read_log() sets its frames
    std::string warning; // set by read_log(): describes what is missing at the end of the session; "" if nothing is

    std::filesystem::path video() const { return folder / "video.mkv"; }
    // Describes the scene files that have changed since the recording, one message each.
    std::vector<std::string> changed_scene_files() const;
};

// Reads a session without its log. If anything is missing or damaged, throws yaml::Error, whose message names file
// and line.
Session read_session(const std::filesystem::path &folder);

// Reads the log in a worker with a sandbox of this mode. Omits frames at the end that are incomplete in the video or
// in the log, with a warning. If anything else is damaged, or if the worker fails, throws yaml::Error, whose message
// names the log and, if possible, the line.
void read_log(Session &session, supervise::Context &context, sandbox::Mode mode, const base::Limits &limits);

} // namespace arhost::cli
