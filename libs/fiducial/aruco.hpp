// SPDX-License-Identifier: Apache-2.0
//
// OpenCV's ArUco markers. Provides a common interface to the detector, which is in a contrib module up to OpenCV 4.6
// and in objdetect from 4.7. Also provides the predefined dictionaries and a reader of a marker's bits.
#pragma once

#include "observations.hpp"

#include <opencv2/core.hpp>
#define ARHOST_OPENCV_HAS_ARUCO_DETECTOR (CV_VERSION_MAJOR * 100 + CV_VERSION_MINOR >= 407)
#if ARHOST_OPENCV_HAS_ARUCO_DETECTOR
#include <opencv2/objdetect/aruco_detector.hpp>
#else
#include <opencv2/aruco.hpp>
#endif

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

namespace arhost::aruco {

#if ARHOST_OPENCV_HAS_ARUCO_DETECTOR
using PredefinedDictionary = cv::aruco::PredefinedDictionaryType;
#else
using PredefinedDictionary = cv::aruco::PREDEFINED_DICTIONARY_NAME;
#endif

struct DetectedMarkers {
    std::vector<int> ids;
    std::vector<std::vector<cv::Point2f>> corners;
    std::vector<std::vector<cv::Point2f>> rejected; // quadrilaterals that match no marker of the dictionary
};

inline cv::aruco::Dictionary predefined(PredefinedDictionary name) {
#if ARHOST_OPENCV_HAS_ARUCO_DETECTOR
    return cv::aruco::getPredefinedDictionary(name);
#else
    return *cv::aruco::getPredefinedDictionary(name);
#endif
}

// Draws a marker. Each cell is one pixel if `side_px` is markerSize + 2·border_bits.
inline void draw(const cv::aruco::Dictionary &dictionary, int id, int side_px, cv::Mat &image, int border_bits) {
#if ARHOST_OPENCV_HAS_ARUCO_DETECTOR
    dictionary.generateImageMarker(id, side_px, image, border_bits);
#else
    dictionary.drawMarker(id, side_px, image, border_bits);
#endif
}

inline fiducial::Print print_of(const cv::aruco::Dictionary &dictionary, int id, int border_bits) {
    cv::Mat drawn;
    draw(dictionary, id, dictionary.markerSize + 2 * border_bits, drawn, border_bits);
    cv::copyMakeBorder(drawn, drawn, 1, 1, 1, 1, cv::BORDER_CONSTANT, 255);
    fiducial::Print print{{}, 1};
    drawn.convertTo(print.cells, CV_32F, 1 / 255.0);
    return print;
}

inline DetectedMarkers detect(const cv::Mat &grey, const cv::aruco::Dictionary &dictionary,
                              const cv::aruco::DetectorParameters &parameters) {
    DetectedMarkers found;
#if ARHOST_OPENCV_HAS_ARUCO_DETECTOR
    cv::aruco::ArucoDetector(dictionary, parameters).detectMarkers(grey, found.corners, found.ids, found.rejected);
#else
    cv::aruco::detectMarkers(grey, cv::makePtr<cv::aruco::Dictionary>(dictionary), found.corners, found.ids,
                             cv::makePtr<cv::aruco::DetectorParameters>(parameters), found.rejected);
#endif
    return found;
}

// The predefined dictionaries, with the names used in options and tracker results.
struct DictionaryType {
    const char *option;
    PredefinedDictionary name;
    const char *family; // reported name: AprilTag's name for its families, otherwise the name in the option
    // Number of bit errors that an AprilTag family can correct, because OpenCV's tables lack it. 0 if the dictionary
    // is not an AprilTag family.
    int april_tag_bits = 0;

    // OpenCV's AprilTag dictionaries are rotated by 180° relative to AprilTag's own library.
    constexpr bool is_april_tag() const { return april_tag_bits > 0; }

    // Returns whether `other` is this dictionary or another one of the same series, such as "DICT_4X4_1000" and
    // "DICT_4X4_50". The dictionaries of a series have markers of the same size, and a larger dictionary begins with
    // the markers of a smaller one.
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

// Returns DetectorParameters::errorCorrectionRate. The more bit errors are corrected, the more squares of random bits
// are mistaken for markers. For a dictionary of 50 markers, these shares are:
// - 4×4 bits: 3 in 1,000 without errors, 5 in 100 with one error
// - 5×5 bits: 2 in 10,000 with one error
// - 6×6 bits: 2 in 100,000 with three errors
double default_correction_rate(const cv::aruco::Dictionary &dictionary);

struct Reading {
    std::uint32_t wrong_bits;
    bool has_whole_border;      // whether each cell of the border is black, or white if the marker is inverted
    double contrast;            // half of the difference between the mean grey levels of white and black cells
    double false_positive_rate; // see arhost_observation
};

// Reads the bits again, because OpenCV does not report how many bits it has corrected. `is_oriented`: whether the
// first corner is the top left one of the upright marker; otherwise it may be any corner.
Reading read(const cv::Mat &grey, const fiducial::Corners &corners_px, const cv::aruco::Dictionary &dictionary,
             int id, int border_bits, bool is_oriented);

} // namespace arhost::aruco
