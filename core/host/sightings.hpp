// SPDX-License-Identifier: Apache-2.0
//
// Counts which markers and targets the tracker sees, and tells the user if targets are not seen for a while.
#pragma once

#include "host/run_parts.hpp"

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
    explicit Sightings(RunParts &parts) : parts_(parts) {}

    // `tracker`: the tracker that is in use from now on.
    void set_tracker(std::shared_ptr<const run_config::TrackerConfiguration> tracker);
    // Counts the results of the tracker. Sets `search.unlisted_count` and `families` of the frame's record.
    void add(Frame &frame);
    // Stores what the tracker sees instead of the targets. The warning that targets were not seen contains this text.
    void add_hint(std::string text);

private:
    void count_other_markers(Frame &frame);
    void warn_of_missing_targets();

    RunParts &parts_;
    std::shared_ptr<const run_config::TrackerConfiguration> tracker_;
    std::vector<std::string> families_;                                  // families of the targets' markers
    std::map<std::pair<std::string, std::int32_t>, std::string> listed_; // the targets' markers, by family and id
    bool has_warned_ = false;
};

} // namespace arhost::host
