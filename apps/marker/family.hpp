// SPDX-License-Identifier: Apache-2.0
//
// The bit patterns of markers, from the libraries that the trackers use.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace arhost::marker {

struct Family {
    std::string name;   // as trackers report it: "tag36h11", "DICT_6X6_250"
    bool is_dictionary; // of OpenCV; otherwise a family of the AprilTag library
    int count;          // ids are 0 to count − 1
    int cells;          // side of a print without its quiet zone
    int border_cells;   // side of the centred square whose corners trackers report
    // Whether each cell is black, in rows from the top left of the upright print (arhost/tracker.h).
    std::function<std::vector<bool>(int id)> black;
};

std::vector<std::string> family_names();
// Also accepts OpenCV's names of AprilTag families (DICT_APRILTAG_36h11). Throws std::runtime_error, which lists
// similar names.
Family find_family(const std::string &name);

// "7,9,12-20" → 7, 9, 12, 13, … Throws std::runtime_error if the text is no list of ids of the family.
std::vector<int> parse_ids(std::string_view text, const Family &family);

} // namespace arhost::marker
