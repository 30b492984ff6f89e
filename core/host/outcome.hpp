// SPDX-License-Identifier: Apache-2.0
//
// Judges a completed run by its statistics: a run whose frames all lack the overlay must not look like a success.
#pragma once

#include "host/statistics.hpp"
#include "run_config/configuration.hpp"

#include <optional>
#include <string>

namespace arhost::host {

struct Problem {
    std::string component; // "tracker" or "raytracer"
    std::string text;
    bool is_missing_target = false; // the tracker works, but has seen none of its markers in any frame
};

// `looked_for`: what the tracker looked for, such as "marker 23 with dictionary DICT_6X6_250".
std::optional<Problem> problem_with_run(const run_config::Configuration &configuration, const Statistics &statistics,
                                        const std::string &looked_for);

// Names the configured markers that were never seen although others were; "" if there are none.
std::string unseen_markers(const run_config::Configuration &configuration, const Statistics &statistics);

// Describes the markers and those options of a tracker that select one of several values, which include the
// dictionary.
std::string describe_targets(const std::vector<arhost_marker_config> &markers, const ipc::PluginDescription &plugin,
                             const std::vector<ipc::OptionValue> &options);

} // namespace arhost::host
