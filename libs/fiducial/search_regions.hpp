// SPDX-License-Identifier: Apache-2.0
//
// Where a tracker has to search in a frame.
#pragma once

#include "observations.hpp"

#include <algorithm>
#include <functional>
#include <future>
#include <optional>
#include <set>
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

    // Adds what another search has found. Searches mostly examine the same quadrilaterals, so `candidates` is that of
    // the search with most of them.
    void add(const Seen &other) {
        markers.insert(markers.end(), other.markers.begin(), other.markers.end());
        candidates = std::max(candidates, other.candidates);
    }
};

// Detects markers in a region of the frame and adds them to `seen`.
using Detect = std::function<void(const cv::Rect &region, Seen &seen)>;

// A search with other thresholds or pixels, for targets that the normal one misses.
struct CloserLook {
    Detect detect;
    bool is_slow; // it searches only a tile of the frame
};

// How to search for the markers of `family`, or for those of all families if it is null.
struct Pass {
    const Family *family;
    Detect detect;
    std::vector<CloserLook> closer_looks = {};
};

// The greatest false_positive_rate of a marker that a closer look may add. It is low because a closer look examines
// more squares, with lower thresholds.
constexpr double max_rate_of_closer_look = 1e-7;

struct FamilyTraits {
    double margin; // what must be visible around a square to detect it, relative to its side
    int bits;      // of the code
};

// Returns an observation if the marker of this id and family is where it is expected. Takes less time than detection.
using Verify = std::function<std::optional<arhost_observation>(const arhost_expected_marker &expected,
                                                               std::int32_t id, std::uint32_t family)>;

// The expected markers that were verified. Not valid: there are none.
using Verified = std::shared_future<std::vector<arhost_observation>>;

// Returns the verified markers when they are ready.
inline std::span<const arhost_observation> markers_of(const Verified &verified) {
    return verified.valid() ? verified.get() : std::span<const arhost_observation>();
}

// Derives rectangles from the markers that a request expects, and searches them.
class SearchRegions {
public:
    SearchRegions(const arhost_tracker_setup &setup,
                  const std::function<FamilyTraits(const std::string &family)> &traits_of);

    // Verifies the expected markers. If everything is to be searched, another thread does so, because detection does
    // not use all processors all the time. `request`, `verify` and what it uses must outlive the result.
    Verified verified(const arhost_track_request &request, const Verify &verify) const;

    // Returns the verified markers and what the passes detect where the others are expected, and, if a target is not
    // there, the other markers that they detect in the whole frame. For targets that are missed, the passes take
    // their closer looks where these are expected, and, if everything is to be searched, in the whole frame, or in
    // tile_of() if they are slow. A marker may be in the result twice.
    Seen search(const arhost_track_request &request, const RegionLimits &limits, std::span<const Pass> passes,
                const Verified &verified = {}) const;

    // Returns rectangles that do not overlap and contain all expected markers, or those of `family`, except those
    // that `seen` has. They are the whole frame if the request says so, or if they would cover most of it.
    std::vector<cv::Rect> rectangles(const arhost_track_request &request, const RegionLimits &limits,
                                     const Family *family = nullptr,
                                     std::span<const arhost_observation> seen = {}) const;

    // Returns whether a target is not where it is expected: none of its expected markers has been seen. The tracker
    // must then search the whole frame.
    bool miss_a_target(const arhost_track_request &request, std::span<const arhost_observation> seen) const;

    // Returns the part of a frame that slow closer looks search, at most tile_width_px × tile_height_px: depends on
    // the number of the frame, in a pseudo-random order.
    static cv::Rect tile_of(cv::Size frame, std::uint64_t sequence);
    static constexpr int tile_width_px = 480, tile_height_px = 360;

private:
    struct Marker {
        std::int32_t id;
        std::uint32_t family, target; // indices in the setup
        FamilyTraits traits;

        bool is(const arhost_observation &seen) const { return seen.id == id && seen.family == family; }
        bool is_in(std::span<const arhost_observation> seen) const {
            return std::ranges::any_of(seen, [&](const arhost_observation &one) { return is(one); });
        }
    };
    using Indices = std::set<std::uint32_t>; // in markers_

    // Returns what the closer looks of all passes find of the missed markers. `regions_of` returns where a look has
    // to search for those of its pass.
    template <class RegionsOf>
    Seen look_closer(std::span<const Pass> passes, const Indices &missed, const RegionsOf &regions_of) const;
    // Returns the markers of the targets of which none has been seen, except those of families with so few bits that
    // a closer look would often find one by chance.
    Indices missed_markers(std::span<const arhost_observation> seen) const;
    // Returns rectangles that do not overlap and contain the expected markers for which `accepts` returns true, or
    // the whole frame if they would cover most of it. Ignores request.search_everywhere.
    std::vector<cv::Rect> around_expected(const arhost_track_request &request, const RegionLimits &limits,
                                          const std::function<bool(const arhost_expected_marker &)> &accepts) const;

    std::vector<Marker> markers_; // as in the setup
};

} // namespace arhost::fiducial
