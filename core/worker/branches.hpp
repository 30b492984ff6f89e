// SPDX-License-Identifier: Apache-2.0
//
// The choice between the two solutions of the planar pose problem, from frame to frame.
#pragma once

#include "pose/projection.hpp"

#include <arhost/tracker.h>

#include <cstdint>
#include <vector>

namespace arhost::worker {

// A tracker computes each pose from one frame, in which noise may decide which of the two solutions has the smaller
// error: the pose then flips. This class remembers the motion of each marker and keeps its pose on one branch, until
// the errors of several frames speak for the other one (pose/track.hpp).
class Branches {
public:
    Branches(const arhost_intrinsics &intrinsics, std::vector<arhost_marker_config> markers);

    // Bytes of `before` and `after`.
    std::uint64_t state_size() const;

    // Exchanges `mt` and `mt_alternative` of DETECTED records whose alternative is the true pose. `before`: what the
    // last call wrote to `after`; null in the first frame.
    void choose(arhost_tracker_result &result, std::int64_t capture_ns, const void *before, void *after) const;

private:
    pose::Projection projection_;
    std::vector<arhost_marker_config> markers_;
};

} // namespace arhost::worker
