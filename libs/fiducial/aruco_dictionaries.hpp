// SPDX-License-Identifier: Apache-2.0
//
// The predefined dictionaries of OpenCV, with the names used in options and tracker results.
#pragma once

#include "opencv_aruco.hpp"

#include <array>
#include <string_view>

namespace arhost::aruco {

struct DictionaryType {
    const char *option;
    PredefinedDictionary name;
    const char *family; // reported name: AprilTag's name for its families, otherwise the name in the option
    // Number of bit errors that an AprilTag family can correct, which OpenCV's tables lack; 0: not an AprilTag
    // family.
    int april_tag_bits = 0;

    // OpenCV's AprilTag dictionaries are rotated by 180° relative to AprilTag's own library.
    constexpr bool is_april_tag() const { return april_tag_bits > 0; }

    // Whether it is this dictionary or one of the same size of markers, of which the larger begins with the smaller:
    // "DICT_4X4_1000" and "DICT_4X4_50".
    constexpr bool is_of_series(std::string_view other) const {
        constexpr std::size_t length = std::string_view("DICT_4X4_").size();
        const std::string_view own = family;
        return own == other ||
               (own.size() > length && own[6] == 'X' && other.substr(0, length) == own.substr(0, length));
    }
};

inline constexpr std::array dictionary_types {
    DictionaryType{"DICT_APRILTAG_36h11", cv::aruco::DICT_APRILTAG_36h11, "tag36h11", 5},
        DictionaryType{"DICT_APRILTAG_36h10", cv::aruco::DICT_APRILTAG_36h10, "tag36h10", 4},
        DictionaryType{"DICT_APRILTAG_25h9", cv::aruco::DICT_APRILTAG_25h9, "tag25h9", 4},
        DictionaryType{"DICT_APRILTAG_16h5", cv::aruco::DICT_APRILTAG_16h5, "tag16h5", 2},
#define ARHOST_DICTIONARY(name) DictionaryType{#name, cv::aruco::name, #name}
        ARHOST_DICTIONARY(DICT_4X4_50), ARHOST_DICTIONARY(DICT_4X4_100), ARHOST_DICTIONARY(DICT_4X4_250),
        ARHOST_DICTIONARY(DICT_4X4_1000), ARHOST_DICTIONARY(DICT_5X5_50), ARHOST_DICTIONARY(DICT_5X5_100),
        ARHOST_DICTIONARY(DICT_5X5_250), ARHOST_DICTIONARY(DICT_5X5_1000), ARHOST_DICTIONARY(DICT_6X6_50),
        ARHOST_DICTIONARY(DICT_6X6_100), ARHOST_DICTIONARY(DICT_6X6_250), ARHOST_DICTIONARY(DICT_6X6_1000),
        ARHOST_DICTIONARY(DICT_7X7_50), ARHOST_DICTIONARY(DICT_7X7_100), ARHOST_DICTIONARY(DICT_7X7_250),
        ARHOST_DICTIONARY(DICT_7X7_1000), ARHOST_DICTIONARY(DICT_ARUCO_ORIGINAL),
#if CV_VERSION_MAJOR * 100 + CV_VERSION_MINOR >= 408
        ARHOST_DICTIONARY(DICT_ARUCO_MIP_36h12),
#endif
#undef ARHOST_DICTIONARY
};

} // namespace arhost::aruco
