// SPDX-License-Identifier: Apache-2.0
//
// Logs which other markers are in view if no listed marker appears. In that case, the configuration probably has the
// wrong family, dictionary or id.
#pragma once

#include "observations.hpp"

#include <opencv2/core.hpp>

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <span>
#include <string>
#include <utility>

namespace arhost::fiducial {

class OtherMarkers {
public:
    using Markers = std::map<std::string, std::set<int>>; // ids by family

    // `find` returns the markers in a picture that the tracker does not report. A call may take a second.
    OtherMarkers(const Host &host, const arhost_tracker_setup &setup,
                 std::function<Markers(const cv::Mat &grey)> find);

    // Call with each frame and the tracker's observations in it. Until a listed marker appears that is not a false
    // positive, searches frames 30, 60, 120 and so on for other markers. If a search finds any, searches the next
    // frame as well. Logs a hint for each family with a marker in both frames, once per family.
    void frame(const cv::Mat &grey, std::span<const arhost_observation> seen);
    // Call at the end. If no listed marker has appeared, searches the last two frames.
    void finish();

private:
    using Id = std::pair<std::uint32_t, std::int32_t>; // family and id

    bool shows_listed(std::span<const arhost_observation> seen);
    Markers search(const cv::Mat &grey);
    void tell(const Markers &markers);

    Host host_;
    std::set<Id> listed_;
    std::function<Markers(const cv::Mat &)> find_;
    // The probability that all sightings of a marker in successive frames are false positives.
    std::map<Id, double> chances_;
    std::set<std::string> named_; // families that a hint has named
    std::uint64_t frames_ = 0, next_search_ = 30;
    Markers candidates_; // found in the previous frame
    bool is_done_ = false;
    cv::Mat previous_, last_; // frames
};

// Returns the markers in a picture that belong to families other than `used`, if all their bits are correct and
// clear. If several dictionaries contain the same markers, names the smallest dictionary with all markers that were
// found. Scales down pictures larger than 1280 px, so it misses small markers in them.
OtherMarkers::Markers markers_of_other_families(const cv::Mat &grey, std::span<const Family> used);

} // namespace arhost::fiducial
