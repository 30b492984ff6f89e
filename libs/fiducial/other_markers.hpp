// SPDX-License-Identifier: Apache-2.0
//
// Tells the user which other markers there are if no listed marker appears: then the configuration probably has the
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

    // `find` returns the markers in a picture that the tracker does not report. It may take a second.
    OtherMarkers(const Host &host, const arhost_tracker_setup &setup,
                 std::function<Markers(const cv::Mat &grey)> find);

    // To be called with each frame and what the tracker has seen in it. Until a listed marker appears that is no
    // chance, searches frames 30, 60, 120 and so on, and if there are markers, also the next frame. Logs a hint with
    // each family once of which both frames have a marker.
    void frame(const cv::Mat &grey, std::span<const arhost_observation> seen);
    // To be called at the end. If no listed marker has appeared, searches the last two frames.
    void finish();

private:
    using Id = std::pair<std::uint32_t, std::int32_t>; // family and id

    bool shows_listed(std::span<const arhost_observation> seen);
    Markers search(const cv::Mat &grey);
    void tell(const Markers &markers);

    Host host_;
    std::set<Id> listed_;
    std::function<Markers(const cv::Mat &)> find_;
    std::map<Id, double> chances_; // that all sightings of a marker in successive frames are chance
    std::set<std::string> named_;  // families
    std::uint64_t frames_ = 0, next_search_ = 30;
    Markers candidates_; // found in the previous frame
    bool is_done_ = false;
    cv::Mat previous_, last_; // frames
};

// Returns the markers in a picture that are not of the families `used`, if all of their bits are right and clear. Of
// dictionaries that contain the same markers, names the smallest one that has all that were found. Reduces pictures
// of more than 1280 px, so it misses small markers there.
OtherMarkers::Markers markers_of_other_families(const cv::Mat &grey, std::span<const Family> used);

} // namespace arhost::fiducial
