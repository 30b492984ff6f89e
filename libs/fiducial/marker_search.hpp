// SPDX-License-Identifier: Apache-2.0
//
// Code shared by the trackers of square markers: options that may change during a run, and the steps of a search.
#pragma once

#include "other_markers.hpp"
#include "search_regions.hpp"
#include "undistortion.hpp"

#include <type_traits>
#include <utility>

namespace arhost::fiducial {

// Sets `value` to the value of the option `key`, if `changed` contains this option.
template <class Value> void take(const Options &changed, const char *key, Value &value) {
    if (!changed.contains(key))
        return;
    if constexpr (std::is_same_v<Value, bool>)
        value = changed.boolean(key);
    else if constexpr (std::is_integral_v<Value>)
        value = static_cast<Value>(changed.integer(key));
    else
        value = changed.real(key);
}

class MarkerSearch {
public:
    MarkerSearch(const Host &host, const arhost_tracker_setup &setup,
                 const std::function<FamilyTraits(const std::string &family)> &traits_of,
                 std::function<OtherMarkers::Markers(const cv::Mat &grey)> find_others)
        : lens_(*setup.intrinsics), regions_(setup, traits_of), others_(host, setup, std::move(find_others)) {}

    // Searches a frame (SearchRegions::search), and reports the observations and hints about other markers.
    void track(const arhost_track_request &request, Observations &observations, const RegionLimits &limits,
               std::span<const Pass> passes, const Verified &verified = {}) {
        Seen seen = regions_.search(request, limits, passes, verified);
        others_.frame(grey_of(*request.frame), seen.markers);
        observations.set_candidate_count(seen.candidates);
        report(std::move(seen.markers), observations);
    }
    void finish() { others_.finish(); }

    const Lens &lens() const { return lens_; }
    const SearchRegions &regions() const { return regions_; }

private:
    Lens lens_;
    SearchRegions regions_;
    OtherMarkers others_;
};

} // namespace arhost::fiducial
