// SPDX-License-Identifier: Apache-2.0
//
// The targets of a tracker.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace arhost::model {

struct TargetMarker {
    std::int32_t id = 0;
    std::string family;                                // family or dictionary
    std::array<std::array<double, 3>, 4> corners_mm{}; // as in arhost_marker_config
    std::string file{};                                // file of a pattern or picture; "" for other markers
    double pattern_ratio = 0;
    bool operator==(const TargetMarker &) const = default;
};

struct Target {
    std::string name;
    std::vector<TargetMarker> markers; // empty for a body
    std::string body;                  // "" for markers
    bool operator==(const Target &) const = default;
};

// Returns the families of all markers, each once, in the order of their first marker. arhost_marker_config.family and
// arhost_observation.family are indices into this list.
std::vector<std::string> families_of(const std::vector<Target> &targets);

} // namespace arhost::model
