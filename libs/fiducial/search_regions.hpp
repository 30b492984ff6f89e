// SPDX-License-Identifier: Apache-2.0
//
// Determines where a tracker has to search in a frame.
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
    int min_side_px = 1; // the detector finds nothing in smaller regions
};

struct Seen {
    // Whether a marker is searched for, by its id and family; a detector omits other listed markers. Empty: all are.
    std::function<bool(std::int32_t id, std::uint32_t family)> wants = {};
    std::vector<arhost_observation> markers = {};
    std::size_t candidates = 0; // number of quadrilaterals that were examined, whether markers or not

    // Adds the result of another search. Searches mostly examine the same quadrilaterals, so `candidates` becomes the
    // larger of both numbers.
    void add(const Seen &other) {
        markers.insert(markers.end(), other.markers.begin(), other.markers.end());
        candidates = std::max(candidates, other.candidates);
    }
};

// Detects markers in a region of the frame and adds them to `seen`.
using Detect = std::function<void(const cv::Rect &region, Seen &seen)>;

// A search with other thresholds or resampled pixels, for targets that the normal search misses.
struct CloserLook {
    Detect detect;
    bool is_slow; // searches only a tile of the frame
};

// A search for the markers of `family`, or for those of all families if `family` is null.
struct Pass {
    const Family *family;
    Detect detect;
    std::vector<CloserLook> closer_looks = {};
};

// The greatest false_positive_rate of a marker that a closer look may add. The limit is low because a closer look
// examines more squares, with lower thresholds.
constexpr double max_rate_of_closer_look = 1e-7;

struct FamilyTraits {
    double margin; // width of the surroundings that a square needs for detection, relative to its side
    int bits;      // number of bits of the code
};

// Returns an observation if the marker `id` of `family` is at its expected place. Takes less time than detection.
using Verify = std::function<std::optional<arhost_observation>(const arhost_expected_marker &expected,
                                                               std::int32_t id, std::uint32_t family)>;

// The expected markers that were verified. If the future is not valid, there are no expected markers.
using Verified = std::shared_future<std::vector<arhost_observation>>;

// Waits for the verification and returns the verified markers.
inline std::span<const arhost_observation> markers_of(const Verified &verified) {
    return verified.valid() ? verified.get() : std::span<const arhost_observation>();
}

// Derives rectangles from the markers that a request expects, and searches the rectangles.
class SearchRegions {
public:
    SearchRegions(const arhost_tracker_setup &setup,
                  const std::function<FamilyTraits(const std::string &family)> &traits_of);

    // Verifies the expected markers. If the whole frame is to be searched, another thread verifies them, because
    // detection does not use all processors all the time. `request`, `verify` and the objects that `verify` uses must
    // outlive the result.
    Verified verified(const arhost_track_request &request, const Verify &verify) const;

    // Returns the verified markers, and the markers that the passes detect where the other expected markers should
    // be. If a target is not at its expected place, also returns the other markers that the passes detect in the
    // whole frame. Takes closer looks for targets that are still missing: first where their markers are expected, and
    // then, if the request asks to search everywhere, in the whole frame (slow looks: in tile_of()). The result may
    // contain a marker twice.
    Seen search(const arhost_track_request &request, const RegionLimits &limits, std::span<const Pass> passes,
                const Verified &verified = {}) const;

    // Returns rectangles that do not overlap and contain all expected markers (of `family`, if it is set), except the
    // markers in `seen`. Returns the whole frame if the request asks for it, or if the rectangles would cover most of
    // it.
    std::vector<cv::Rect> rectangles(const arhost_track_request &request, const RegionLimits &limits,
                                     const Family *family = nullptr,
                                     std::span<const arhost_observation> seen = {}) const;

    // Returns whether a target is not at its expected place, because none of its expected markers has been seen. The
    // tracker must then search the whole frame.
    bool miss_a_target(const arhost_track_request &request, std::span<const arhost_observation> seen) const;

    // Returns the part of a frame that slow closer looks search, at most tile_width_px × tile_height_px. The part
    // changes with the frame number in a pseudo-random order.
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
    using Indices = std::set<std::uint32_t>; // indices of markers_

    // Returns the missed markers that the closer looks of all passes find. `regions_of` returns the regions that a
    // look has to search for the missed markers of its pass.
    template <class RegionsOf>
    Seen look_closer(std::span<const Pass> passes, const Indices &missed, const RegionsOf &regions_of) const;
    // Returns the markers of those targets of which no marker has been seen. Excludes families with so few bits that
    // a closer look would often cause false positives.
    Indices missed_markers(std::span<const arhost_observation> seen) const;
    // Returns rectangles that do not overlap and contain the expected markers for which `accepts` returns true.
    // Returns the whole frame if the rectangles would cover most of it. Ignores request.search_everywhere.
    std::vector<cv::Rect> around_expected(const arhost_track_request &request, const RegionLimits &limits,
                                          const std::function<bool(const arhost_expected_marker &)> &accepts) const;

    std::vector<Marker> markers_; // in the order of the setup
};

} // namespace arhost::fiducial
