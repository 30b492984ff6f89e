// SPDX-License-Identifier: Apache-2.0
#include "other_markers.hpp"

#include <algorithm>
#include <exception>
#include <utility>

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

} // namespace arhost::fiducial
