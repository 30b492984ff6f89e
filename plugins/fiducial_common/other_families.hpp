// SPDX-License-Identifier: Apache-2.0
//
// Tells the user which markers of other families there are if no listed marker appears: then the configuration
// probably has the wrong family or dictionary.
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <opencv2/core.hpp>

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <span>
#include <string>
#include <utility>

namespace arhost::fiducial {

class OtherFamilies {
public:
    using Markers = std::map<std::string, std::set<int>>; // ids by family

    // `find` returns the markers in a picture that belong to families without listed markers. It may take a second.
    OtherFamilies(const Host &host, const arhost_tracker_setup &setup,
                  std::function<Markers(const cv::Mat &grey)> find);

    // To be called with each frame and what the tracker has seen in it. Until a listed marker appears, searches
    // frames 30, 60, 120 and so on, and logs the markers that it finds, once.
    void frame(const cv::Mat &grey, std::span<const arhost_observation> seen);
    // To be called at the end. Searches the last frame if no listed marker has appeared.
    void finish();

private:
    void search();

    Host host_;
    std::set<std::pair<std::uint32_t, std::int32_t>> listed_; // family and id
    std::function<Markers(const cv::Mat &)> find_;
    std::uint64_t frames_ = 0, next_search_ = 30;
    bool is_done_ = false;
    cv::Mat last_;
};

} // namespace arhost::fiducial
