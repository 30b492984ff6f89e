// SPDX-License-Identifier: Apache-2.0
#include "marker_print.hpp"

#include <arhost-cpp/plugin.hpp>

#include <opencv2/core.hpp>
#define ARHOST_OPENCV_HAS_ARUCO_DETECTOR (CV_VERSION_MAJOR * 100 + CV_VERSION_MINOR >= 407)
#if ARHOST_OPENCV_HAS_ARUCO_DETECTOR
#include <opencv2/objdetect/aruco_detector.hpp>
#else
#include <opencv2/aruco.hpp>
#endif

#include <algorithm>
#include <array>
#include <string>

namespace arhost::synthetic {
namespace {

struct Family {
    const char *name;
    int dictionary;
    bool rotated_180 = false; // OpenCV's AprilTag dictionaries are rotated by 180° relative to AprilTag's library
};

constexpr std::array families{
    Family{"tag36h11", cv::aruco::DICT_APRILTAG_36h11, true},
    Family{"tag36h10", cv::aruco::DICT_APRILTAG_36h10, true},
    Family{"tag25h9", cv::aruco::DICT_APRILTAG_25h9, true},
    Family{"tag16h5", cv::aruco::DICT_APRILTAG_16h5, true},
#define ARHOST_FAMILY(name) Family{#name, cv::aruco::name}
    ARHOST_FAMILY(DICT_4X4_50),
    ARHOST_FAMILY(DICT_4X4_100),
    ARHOST_FAMILY(DICT_4X4_250),
    ARHOST_FAMILY(DICT_4X4_1000),
    ARHOST_FAMILY(DICT_5X5_50),
    ARHOST_FAMILY(DICT_5X5_100),
    ARHOST_FAMILY(DICT_5X5_250),
    ARHOST_FAMILY(DICT_5X5_1000),
    ARHOST_FAMILY(DICT_6X6_50),
    ARHOST_FAMILY(DICT_6X6_100),
    ARHOST_FAMILY(DICT_6X6_250),
    ARHOST_FAMILY(DICT_6X6_1000),
    ARHOST_FAMILY(DICT_7X7_50),
    ARHOST_FAMILY(DICT_7X7_100),
    ARHOST_FAMILY(DICT_7X7_250),
    ARHOST_FAMILY(DICT_7X7_1000),
    ARHOST_FAMILY(DICT_ARUCO_ORIGINAL),
#undef ARHOST_FAMILY
};

constexpr auto names = [] {
    std::array<const char *, families.size() + 1> list{};
    std::ranges::transform(families, list.begin(), &Family::name);
    return list;
}();

} // namespace

std::span<const char *const> marker_families() {
    return names;
}

cv::Mat_<uint8_t> marker_cells(std::string_view name, std::int64_t id) {
    const auto family = std::ranges::find(families, name, [](const Family &f) { return std::string_view(f.name); });
    if (family == families.end())
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "family: unknown '" + std::string(name) +
                          "'; use an AprilTag family (tag36h11) or an OpenCV dictionary (DICT_6X6_250)");
#if ARHOST_OPENCV_HAS_ARUCO_DETECTOR
    const auto dictionary = cv::aruco::getPredefinedDictionary(family->dictionary);
#else
    const cv::aruco::Dictionary dictionary = *cv::aruco::getPredefinedDictionary(family->dictionary);
#endif
    if (id < 0 || id >= dictionary.bytesList.rows)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "id: " + std::string(name) + " has the ids 0 to " +
                                                             std::to_string(dictionary.bytesList.rows - 1) +
                                                             ", not " + std::to_string(id));
    cv::Mat cells;
    const int side = dictionary.markerSize + 2;
#if ARHOST_OPENCV_HAS_ARUCO_DETECTOR
    dictionary.generateImageMarker(static_cast<int>(id), side, cells, 1);
#else
    dictionary.drawMarker(static_cast<int>(id), side, cells, 1);
#endif
    if (family->rotated_180)
        cv::rotate(cells, cells, cv::ROTATE_180);
    return cells;
}

} // namespace arhost::synthetic
