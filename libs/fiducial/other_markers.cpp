// SPDX-License-Identifier: Apache-2.0
#include "other_markers.hpp"

#include "april_tags.hpp"
#include "aruco.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <exception>
#include <memory>
#include <utility>
#include <vector>

namespace arhost::fiducial {
namespace {

OtherMarkers::Markers in_both(OtherMarkers::Markers first, const OtherMarkers::Markers &second) {
    for (auto &[family, ids] : first) {
        const auto found = second.find(family);
        std::erase_if(ids, [&](int id) { return found == second.end() || !found->second.contains(id); });
    }
    return first;
}

std::string text_of(const std::set<int> &ids) {
    constexpr std::size_t max_named = 5;
    std::size_t named = 0;
    std::string text;
    for (const int id : ids) {
        if (named == max_named)
            return text + " and " + std::to_string(ids.size() - max_named) + " more";
        text += (named++ == 0 ? "" : ", ") + std::to_string(id);
    }
    return text;
}

using aruco::dictionary_types;
using aruco::DictionaryType;

void add_april_tags(const cv::Mat &grey, std::span<const Family> used, OtherMarkers::Markers &markers) {
    constexpr float min_contrast = 20; // grey levels; low-contrast clutter may match a tag of a small family
    using TagFamily = std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t *)>;
    std::vector<TagFamily> families; // outlive the detector
    const apriltag::Detector detector(apriltag_detector_create(), apriltag_detector_destroy);
    detector->quad_decimate = 1;
    for (const apriltag::FamilyType &type : apriltag::family_types)
        if (std::ranges::find(used, type.name, &Family::name) == used.end()) {
            families.emplace_back(type.create(), type.destroy);
            apriltag_detector_add_family_bits(detector.get(), families.back().get(), 0);
        }
    apriltag::detect(*detector, grey, [&](const apriltag_detection_t &tag) {
        if (tag.decision_margin >= min_contrast)
            markers[tag.family->name].insert(tag.id);
    });
}

// The dictionaries of a series, such as "DICT_4X4_50" and "DICT_4X4_100", begin with the markers of the smaller ones.
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

OtherMarkers::OtherMarkers(const Host &host, const arhost_tracker_setup &setup,
                           std::function<Markers(const cv::Mat &grey)> find)
    : host_(host), find_(std::move(find)) {
    for (const arhost_marker_config &marker : elements(setup.markers, setup.marker_count))
        listed_.emplace(marker.family, marker.id);
}

void OtherMarkers::frame(const cv::Mat &grey, std::span<const arhost_observation> seen) {
    if (is_done_)
        return;
    ++frames_;
    is_done_ = shows_listed(seen);
    if (is_done_) {
        previous_.release();
        last_.release();
        return;
    }
    std::swap(previous_, last_);
    grey.copyTo(last_);
    if (!candidates_.empty()) {
        tell(in_both(std::exchange(candidates_, {}), search(grey)));
    } else if (frames_ == next_search_) {
        next_search_ *= 2;
        candidates_ = search(grey);
    }
}

void OtherMarkers::finish() {
    if (!is_done_ && !last_.empty()) {
        Markers markers = search(last_);
        if (!markers.empty() && !previous_.empty())
            markers = in_both(std::move(markers), search(previous_));
        tell(markers);
    }
    is_done_ = true;
}

bool OtherMarkers::shows_listed(std::span<const arhost_observation> seen) {
    constexpr double max_chance = 1e-7;
    std::map<Id, double> chances;
    for (const arhost_observation &one : seen) {
        const Id id{one.family, one.id};
        if (!listed_.contains(id))
            continue;
        const auto before = chances_.find(id);
        chances[id] = one.false_positive_rate *
                      (before == chances_.end() ? static_cast<double>(listed_.size()) : before->second);
        if (chances[id] < max_chance)
            return true;
    }
    chances_ = std::move(chances);
    return false;
}

OtherMarkers::Markers OtherMarkers::search(const cv::Mat &grey) {
    try {
        return is_done_ ? Markers() : find_(grey);
    } catch (const std::exception &error) {
        host_.warn(std::string("the search for other markers failed: ") + error.what());
        is_done_ = true;
        return {};
    }
}

void OtherMarkers::tell(const Markers &markers) {
    std::string text;
    for (const auto &[family, ids] : markers)
        if (!ids.empty() && named_.insert(family).second)
            text += (text.empty() ? "" : "; ") + family + " " + text_of(ids);
    if (!text.empty())
        host_.hint("other markers were in view: " + text);
}

OtherMarkers::Markers markers_of_other_families(const cv::Mat &grey, std::span<const Family> used) {
    constexpr int max_side_px = 1280; // limits the search to less than a second
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
