// SPDX-License-Identifier: Apache-2.0
//
// The cells of markers, from the libraries that the trackers use, and pictures of ARToolKit's patterns.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace arhost::marker {

// Grey levels in a centred square over the cells.
struct Picture {
    double ratio; // side of the picture relative to that of the square whose corners trackers report
    int side;
    std::vector<std::uint8_t> grey; // in rows from the top left; 0 is black
};

struct Family {
    std::string name;   // as trackers report it: "tag36h11", "DICT_6X6_250"; for a pattern, the name of the file
    bool is_dictionary; // true: a dictionary of OpenCV; false: a family of the AprilTag library or of ARToolKit
    int count;          // ids are 0 to count − 1
    int cells;          // side of a print without its quiet zone
    int border_cells;   // side of the centred square whose corners trackers report
    // Whether each cell is black, in rows from the top left of the upright print (arhost/tracker.h).
    std::function<std::vector<bool>(int id)> black;
    double quiet; // minimum width of the white margin, relative to the side of the square of border_cells
    std::optional<Picture> picture{};
};

std::vector<std::string> family_names();
// Also accepts OpenCV's names of AprilTag families (DICT_APRILTAG_36h11). Throws std::runtime_error, whose message
// lists similar names.
Family find_family(const std::string &name);

// Returns a "family" whose only marker is the pattern in a file of ARToolKit. Throws std::runtime_error.
Family read_pattern(const std::string &file, double ratio);

// "7,9,12-20" → 7, 9, 12, 13, … Throws std::runtime_error if the text is no list of ids of the family.
std::vector<int> parse_ids(std::string_view text, const Family &family);

} // namespace arhost::marker
