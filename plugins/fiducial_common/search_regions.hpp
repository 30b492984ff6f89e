// SPDX-License-Identifier: Apache-2.0
//
// Where a tracker has to search in a frame.
#pragma once

#include "observations.hpp"

#include <algorithm>
#include <functional>
#include <optional>
#include <span>

namespace arhost::fiducial {

// Requirements of a detector on the regions that it searches.
struct RegionLimits {
    int grid_px = 1;     // regions begin at multiples of this
    int min_side_px = 1; // in smaller regions, nothing is detected
};

struct Seen {
    std::vector<arhost_observation> markers;
    std::size_t candidates = 0; // quadrilaterals that were examined, those of markers and others

    // Adds what another search of the same quadrilaterals has found.
    void add(const Seen &other) {
        markers.insert(markers.end(), other.markers.begin(), other.markers.end());
        candidates = std::max(candidates, other.candidates);
    }
};

// Detects markers in a region of the frame and adds them to `seen`.
using Detect = std::function<void(const cv::Rect &region, Seen &seen)>;

// How to search for the markers of `family`, or for those of all families if it is null.
struct Pass {
    const Family *family;
    Detect detect;
    std::vector<Detect> closer_looks = {}; // slower, but find more of the small and faint markers
};

// A closer look examines more squares with lower thresholds, so it reports only listed markers whose
// false_positive_rate is at most this. That leaves out families of up to 25 bits.
constexpr double max_rate_of_closer_look = 1e-7;

// Returns an observation if the marker of this id and family is where it is expected. Takes less time than detection.
using Verify = std::function<std::optional<arhost_observation>(const arhost_expected_marker &expected,
                                                               std::int32_t id, std::uint32_t family)>;

// Derives rectangles from the markers that a request expects, and searches them.
class SearchRegions {
public:
    // `margin`: what must be visible around a square of a family to detect it, relative to its side.
    SearchRegions(const arhost_tracker_setup &setup, const std::function<double(const std::string &family)> &margin);

    // Returns the expected markers that `verify` confirms and what the passes detect where the others are expected,
    // or what they detect in the whole frame if a target is not there. Where a target is missed, the passes also
    // take their closer looks: at the expected places, and after a search of the whole frame in tile_of(). A marker
    // may be in the result twice.
    Seen search(const arhost_track_request &request, const RegionLimits &limits, std::span<const Pass> passes,
                const Verify &verify = {}) const;

    // Returns rectangles that do not overlap and contain all expected markers, or those of `family`, except those
    // that `seen` has. They are the whole frame if the request says so, or if they would cover most of it.
    std::vector<cv::Rect> of(const arhost_track_request &request, const RegionLimits &limits,
                             const Family *family = nullptr, std::span<const arhost_observation> seen = {}) const;

    // Returns whether a target is not where it is expected: none of its expected markers has been seen. The tracker
    // must then search the whole frame.
    bool miss_a_target(const arhost_track_request &request, std::span<const arhost_observation> seen) const;

    // Returns the part of a frame that is searched closer, at most tile_width_px × tile_height_px: the frames of a
    // video take turns with the parts, in an order that reaches all of them even if only every nth frame is searched.
    static cv::Rect tile_of(cv::Size frame, std::uint64_t sequence);
    static constexpr int tile_width_px = 480, tile_height_px = 360;

private:
    struct Marker {
        std::int32_t id;
        std::uint32_t family, target; // indices in the setup
        double margin;                // relative to its side

        bool is_in(std::span<const arhost_observation> seen) const {
            return std::ranges::any_of(
                seen, [&](const arhost_observation &one) { return one.id == id && one.family == family; });
        }
    };
    bool are_all_targets_in(std::span<const arhost_observation> seen) const;

    std::vector<Marker> markers_; // as in the setup
};

} // namespace arhost::fiducial
