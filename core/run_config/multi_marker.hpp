// SPDX-License-Identifier: Apache-2.0
//
// Reads multi-marker files of ARToolKit.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace arhost::run_config {

struct MultiMarker {
    std::string where; // "marker.dat:12"
    std::string print; // the file of a pattern, or the id of a matrix code
    double side_mm;
    glm::dmat3 rotation; // from the marker's to the map's coordinates
    glm::dvec3 position_mm;

    [[noreturn]] void fail(const std::string &message) const; // throws yaml::Error
};

// Returns whether the first line that has any content is a number, which no YAML map begins with.
bool is_multi_marker_file(std::string_view text);

// Parses the contents of a file. Throws yaml::Error.
std::vector<MultiMarker> parse_multi_marker_file(const std::filesystem::path &file, std::string_view text);

} // namespace arhost::run_config
