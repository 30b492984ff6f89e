// SPDX-License-Identifier: Apache-2.0
//
// A common interface to OpenCV's ArUco detector, which is in a contrib module up to OpenCV 4.6 and in objdetect
// from 4.7.
#pragma once

#include "print.hpp"

#include <opencv2/core.hpp>
#define ARHOST_OPENCV_HAS_ARUCO_DETECTOR (CV_VERSION_MAJOR * 100 + CV_VERSION_MINOR >= 407)
#if ARHOST_OPENCV_HAS_ARUCO_DETECTOR
#include <opencv2/objdetect/aruco_detector.hpp>
#else
#include <opencv2/aruco.hpp>
#endif

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
    std::vector<std::vector<cv::Point2f>> rejected; // quadrilaterals that are none of the dictionary's markers
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

} // namespace arhost::aruco
