// SPDX-License-Identifier: Apache-2.0
//
// Parses the targets of a tracker: single markers, maps of several markers, and bodies (rigid objects that the
// tracker knows by name and whose poses it reports itself).
#pragma once

#include "model/target.hpp"
#include "yaml/yaml.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace arhost::run_config {

using model::Target;
using model::TargetMarker;

// Parses the key `targets` of a tracker. Appends the node of each target to `nodes`; a node with `ids` defines many
// targets. Appends the absolute paths of the maps that it reads to `map_files`. All functions throw yaml::Error and
// append their warnings to `warnings`.
std::vector<Target> parse_targets(const yaml::Node &targets, std::vector<yaml::Node> &nodes,
                                  std::vector<std::filesystem::path> &map_files, std::vector<std::string> &warnings);

// Reads a map of markers (docs/markers.md).
std::vector<TargetMarker> read_map(const std::filesystem::path &file, std::vector<std::string> &warnings);

// Both functions reject the configuration of a tracker or an alternative tracker that still has a key or an option of
// earlier versions that `targets` has replaced.
void reject_markers(const yaml::Node &tracker);
void reject_family_option(const yaml::Node &tracker);

} // namespace arhost::run_config
