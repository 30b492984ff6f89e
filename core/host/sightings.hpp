// SPDX-License-Identifier: Apache-2.0
//
// Counts which markers and targets the tracker sees, and tells the user if targets are not seen for a while.
#pragma once

#include "base/clock.hpp"
#include "host/frame.hpp"
#include "run_config/configuration.hpp"
#include "supervise/launcher.hpp"

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace arhost::host {

// Counts the frame's targets and its search.
void count_targets(const Frame &frame, Statistics &statistics);

class Sightings {
public:
    Sightings(const run_config::Configuration &configuration, const base::Clock &clock,
              const supervise::LogFunction &log, Statistics &statistics)
        : configuration_(configuration), clock_(clock), log_(log), statistics_(statistics) {}

    // `tracker` is the one in use from now on.
    void set_tracker(std::shared_ptr<const run_config::TrackerConfiguration> tracker);
    // Counts the results of the tracker. Sets `search.unlisted_count` and `families` of the frame's record.
    void add(Frame &frame);
    // Keeps what the tracker sees instead of the targets for the warning that they were not seen.
    void add_hint(std::string text);

private:
    void count_other_markers(Frame &frame);
    void warn_of_missing_targets();

    const run_config::Configuration &configuration_;
    const base::Clock &clock_;
    const supervise::LogFunction &log_;
    Statistics &statistics_;
    std::shared_ptr<const run_config::TrackerConfiguration> tracker_;
    std::vector<std::string> families_;                                  // of the targets' markers
    std::map<std::pair<std::string, std::int32_t>, std::string> listed_; // the targets' markers, by family and id
    bool has_warned_ = false;
};

} // namespace arhost::host
