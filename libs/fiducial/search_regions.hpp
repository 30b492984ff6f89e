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
    // The largest part of the frame that the look searches at expected places. A look with less than 1 is slow: where
    // nothing is expected, it searches a tile.
    double max_part = 1;

    bool is_slow() const { return max_part < 1; }
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

    // Verifies the expected markers, the largest first.
    std::vector<arhost_observation> verified_markers(const arhost_track_request &request, const Verify &verify) const;
    // Verifies them when the result is needed. If the whole frame is to be searched, another thread verifies them,
    // because detection does not use all processors all the time. `request`, `verify` and the objects that `verify`
    // uses must outlive the result.
    Verified verified(const arhost_track_request &request, const Verify &verify) const;

    // Returns the verified markers, and the markers that the passes detect where the other expected markers should
    // be. If a target is not at its expected place, also returns the other markers that the passes detect in the
    // whole frame. Takes closer looks for targets that are missing after the first search: all looks where their
    // markers are expected. If there is no such place and the request asks to search everywhere, a single look in the
    // whole frame (a slow look: in a tile); the number of the frame tells which look, and which tile. The result may
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

    // Returns whether search() takes a closer look for markers of `family` (null: of any family) if its first search
    // finds only `seen`.
    bool needs_closer_look(const arhost_track_request &request, std::span<const arhost_observation> seen,
                           const Family *family = nullptr) const;

    // The tiles of a frame that slow looks search, 3/7 of its width and height each, in columns and rows that
    // overlap. A marker of up to 1/7 of the width and 1/5 of the height is completely in at least one tile.
    static constexpr unsigned tile_columns = 3, tile_rows = 4, tile_count = tile_columns * tile_rows;
    static cv::Rect tile_of(cv::Size frame, const RegionLimits &limits, unsigned index);
    // Returns a number below `count` for a frame. Each number occurs once among `count` successive frames from a
    // multiple of `count`, and so at least once among any 2·count − 1. Each begins with a pseudo-random number,
    // because a regular order omits numbers if only every nth frame is searched.
    static unsigned turn_of(std::uint64_t sequence, unsigned count);

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

    // A closer look and the regions that it searches.
    struct LookAt {
        const CloserLook *look;
        std::vector<cv::Rect> regions; // not empty
    };

    // Returns the markers of `missed` that belong to `family`, or all if `family` is null.
    Indices wanted_of(const Family *family, const Indices &missed) const;
    // Returns all closer looks where the missed markers are expected.
    std::vector<LookAt> looks_at_expected(const arhost_track_request &request, const RegionLimits &limits,
                                          std::span<const Pass> passes, const Indices &missed) const;
    // Returns the closer look whose turn it is in this frame; none if no pass has one for the missed markers.
    std::vector<LookAt> look_in_turn(const arhost_track_request &request, const RegionLimits &limits,
                                     std::span<const Pass> passes, const Indices &missed) const;
    // Returns the missed markers that the look finds.
    Seen look_closer(const LookAt &look, const Indices &missed) const;
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
