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
    bool is_missing_target = false; // the tracker works, but has seen none of its targets in any frame
};

// `targets`: the targets of the tracker that was in use at the end of the run.
std::optional<Problem> problem_with_run(const run_config::Configuration &configuration, const Statistics &statistics,
                                        const std::vector<model::Target> &targets);

// Names the targets that were never seen, if others were seen; otherwise returns "".
std::string unseen_targets(const run_config::Configuration &configuration, const Statistics &statistics,
                           const std::vector<model::Target> &targets);

// Says what the tracker looks for, what it saw instead, and what to check: "it looks for 'desk' (tag36h11 23); …".
std::string looks_for(const Statistics &statistics, const std::vector<model::Target> &targets);

// If no target was visible for a while, says so and what the tracker looks for; otherwise returns "".
std::string missing_target(const run_config::Configuration &configuration, const Statistics &statistics,
                           const std::vector<model::Target> &targets, std::chrono::steady_clock::time_point now);

// Names the targets whose observed corners differ from the projections with their poses; "" if there are none.
std::string misfitting_targets(const Statistics &statistics, const std::vector<model::Target> &targets);

// Names a marker by its family and its id or, if it has one, its file: "tag36h11 23", "pattern hiro.patt".
std::string marker_name(const model::TargetMarker &marker);

// Describes what a tracker looks for, such as "desk (tag36h11 23), board (map of 12 markers)".
std::string describe_targets(const std::vector<model::Target> &targets);

// Describes what the tracker saw instead of the unseen targets, as "; it saw tag36h11 5 (30 frames)"; "" if nothing.
std::string seen_instead(const Statistics &statistics, const std::vector<model::Target> &unseen);

// Returns a hint on what to check if targets are not seen, such as "; compare the numbers and the family with the
// print"; "" for bodies.
std::string how_to_compare(const std::vector<model::Target> &unseen);

// Names the most frequent markers that belong to no target, as "tag36h11 5 (30 frames)"; "" if there are none.
std::string unlisted_text(const Statistics &statistics);

} // namespace arhost::host
