// SPDX-License-Identifier: Apache-2.0
#include "other_families.hpp"

#include <algorithm>

namespace arhost::fiducial {

OtherFamilies::OtherFamilies(const Host &host, const arhost_tracker_setup &setup,
                             std::function<Markers(const cv::Mat &grey)> find)
    : host_(host), find_(std::move(find)) {
    for (std::uint32_t i = 0; i < setup.marker_count; ++i)
        listed_.emplace(setup.markers[i].family, setup.markers[i].id);
}

void OtherFamilies::frame(const cv::Mat &grey, std::span<const arhost_observation> seen) {
    if (is_done_)
        return;
    ++frames_;
    is_done_ = std::ranges::any_of(seen, [&](const arhost_observation &one) {
        return listed_.contains({one.family, one.id});
    });
    if (is_done_) {
        last_.release();
        return;
    }
    grey.copyTo(last_);
    if (frames_ == next_search_) {
        next_search_ *= 2;
        search();
    }
}

void OtherFamilies::finish() {
    if (!is_done_ && !last_.empty())
        search();
    is_done_ = true;
}

void OtherFamilies::search() {
    std::string text;
    for (const auto &[family, ids] : find_(last_)) {
        if (ids.empty())
            continue;
        constexpr std::size_t max_named = 5;
        std::size_t named = 0;
        text += (text.empty() ? "" : "; ") + family + " ";
        for (const int id : ids) {
            if (named == max_named) {
                text += " and " + std::to_string(ids.size() - max_named) + " more";
                break;
            }
            text += (named++ == 0 ? "" : ", ") + std::to_string(id);
        }
    }
    if (text.empty())
        return;
    host_.info("no listed marker was seen in " + std::to_string(frames_) +
               " frames, but this one has markers of other families: " + text);
    is_done_ = true;
    last_.release();
}

} // namespace arhost::fiducial
