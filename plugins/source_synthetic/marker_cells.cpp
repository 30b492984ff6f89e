// SPDX-License-Identifier: Apache-2.0
#include "marker_cells.hpp"

#include <fiducial/aruco.hpp>

#include <arhost-cpp/plugin.hpp>

#include <algorithm>
#include <array>
#include <string>

namespace arhost::synthetic {

std::span<const char *const> marker_families() {
    static constexpr auto names = [] {
        std::array<const char *, aruco::dictionary_types.size() + 1> list{};
        std::ranges::transform(aruco::dictionary_types, list.begin(), &aruco::DictionaryType::family);
        return list;
    }();
    return names;
}

cv::Mat_<uint8_t> marker_cells(const std::string &family, std::int64_t id) {
    const auto type = std::ranges::find(aruco::dictionary_types, family, &aruco::DictionaryType::family);
    if (type == aruco::dictionary_types.end())
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "family: unknown '" + family +
                          "'; use an AprilTag family (tag36h11) or an OpenCV dictionary (DICT_6X6_250)");
    const cv::aruco::Dictionary dictionary = aruco::predefined(type->name);
    const int last_id = dictionary.bytesList.rows - 1;
    if (id < 0 || id > last_id)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "id: " + family + " has the ids 0 to " +
                                                             std::to_string(last_id) + ", not " + std::to_string(id));
    cv::Mat cells;
    aruco::draw(dictionary, static_cast<int>(id), dictionary.markerSize + 2, cells, 1);
    if (type->is_april_tag())
        cv::rotate(cells, cells, cv::ROTATE_180);
    return cells;
}

} // namespace arhost::synthetic
