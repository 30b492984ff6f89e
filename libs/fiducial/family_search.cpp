// SPDX-License-Identifier: Apache-2.0
#include "family_search.hpp"

#include "apriltag_families.hpp"
#include "aruco_dictionaries.hpp"
#include "aruco_reading.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <memory>
#include <set>
#include <utility>
#include <vector>

namespace arhost::fiducial {
namespace {

using aruco::dictionary_types;
using aruco::DictionaryType;

void add_april_tags(const cv::Mat &grey, std::span<const Family> used, OtherMarkers::Markers &markers) {
    constexpr int min_side = 8;        // the library reads out of bounds in smaller images
    constexpr float min_contrast = 20; // grey levels; clutter of less contrast may read as a tag of a small family
    if (std::min(grey.cols, grey.rows) < min_side)
        return;
    using TagFamily = std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t *)>;
    std::vector<TagFamily> families; // outlive the detector
    const std::unique_ptr<apriltag_detector_t, decltype(&apriltag_detector_destroy)> detector(
        apriltag_detector_create(), apriltag_detector_destroy);
    detector->quad_decimate = 1;
    for (const apriltag::FamilyType &type : apriltag::family_types)
        if (std::ranges::find(used, type.name, &Family::name) == used.end()) {
            families.emplace_back(type.create(), type.destroy);
            apriltag_detector_add_family_bits(detector.get(), families.back().get(), 0);
        }
    image_u8_t image{grey.cols, grey.rows, static_cast<int>(grey.step), grey.data};
    const std::unique_ptr<zarray_t, decltype(&apriltag_detections_destroy)> tags(
        apriltag_detector_detect(detector.get(), &image), apriltag_detections_destroy);
    for (int i = 0; tags && i < zarray_size(tags.get()); ++i) {
        apriltag_detection_t *tag = nullptr;
        zarray_get(tags.get(), i, &tag);
        if (tag->decision_margin >= min_contrast)
            markers[tag->family->name].insert(tag->id);
    }
}

// Each dictionary of "DICT_4X4_50", "DICT_4X4_100" and so on begins with the markers of the smaller ones.
void add_aruco_markers(const cv::Mat &grey, std::span<const Family> used, OtherMarkers::Markers &markers) {
    cv::aruco::DetectorParameters parameters;
    parameters.errorCorrectionRate = 0;
    parameters.minMarkerDistanceRate = 0.02; // the default misses prints with a narrow white margin
    for (auto largest = dictionary_types.begin(); largest != dictionary_types.end(); ++largest) {
        const auto next = largest + 1;
        if (largest->is_april_tag() || (next != dictionary_types.end() && next->is_of_series(largest->family)))
            continue;
        const auto is_used = [&](int id) {
            return std::ranges::any_of(used, [&](const Family &family) {
                return largest->is_of_series(family.name) && id < family.id_count;
            });
        };
        const cv::aruco::Dictionary dictionary = aruco::predefined(largest->name);
        const aruco::DetectedMarkers found = aruco::detect(grey, dictionary, parameters);
        std::set<int> ids;
        for (std::size_t i = 0; i < found.ids.size(); ++i) {
            Corners corners_px;
            std::ranges::copy(found.corners[i], corners_px.begin());
            const aruco::Reading reading =
                aruco::read(grey, corners_px, dictionary, found.ids[i], parameters.markerBorderBits, true);
            if (reading.has_whole_border && reading.false_positive_rate < 1 && !is_used(found.ids[i]))
                ids.insert(found.ids[i]);
        }
        if (ids.empty())
            continue;
        const auto smallest = std::ranges::find_if(dictionary_types, [&](const DictionaryType &type) {
            return largest->is_of_series(type.family) && *ids.rbegin() < aruco::predefined(type.name).bytesList.rows;
        });
        markers[smallest->family] = std::move(ids);
    }
}

} // namespace

OtherMarkers::Markers markers_of_other_families(const cv::Mat &grey, std::span<const Family> used) {
    constexpr int max_side_px = 1280; // so that it takes less than a second
    cv::Mat reduced = grey;
    if (const double scale = static_cast<double>(max_side_px) / std::max(grey.cols, grey.rows); scale < 1)
        cv::resize(grey, reduced, {std::max(1, cvRound(scale * grey.cols)), std::max(1, cvRound(scale * grey.rows))},
                   0, 0, cv::INTER_AREA);
    OtherMarkers::Markers markers;
    add_april_tags(reduced, used, markers);
    add_aruco_markers(reduced, used, markers);
    return markers;
}

} // namespace arhost::fiducial
