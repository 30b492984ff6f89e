// SPDX-License-Identifier: Apache-2.0
//
// Map files (docs/markers.md).
#pragma once

#include "learning.hpp"
#include "marker/family.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace arhost::map {

// Reads the markers of a map file. Throws yaml::Error, whose message names file, line and key. Throws it also if the
// map is of another family.
std::vector<Marker> read_map(const std::filesystem::path &file, const marker::Family &family);

// `comment`: the first lines, each beginning with #.
std::string map_text(const std::vector<LearnedMarker> &markers, const marker::Family &family,
                     const std::string &comment);

} // namespace arhost::map
