// SPDX-License-Identifier: Apache-2.0
//
// The pose of a target over time: decides which of two solutions of the planar pose problem is the true one, and
// predicts the pose in the next frame.
#pragma once

#include "pose/motion_filter.hpp"

#include <cstdint>
#include <optional>
#include <span>

namespace arhost::pose {

// The memory of one target. Plain data without pointers, because it is kept in shared memory across restarts;
// all zero if the target was never seen.
struct Track {
    std::int64_t capture_ns;      // capture time of the last frame in which the target was detected
    std::uint32_t branches;       // 0: never seen; 2 if the last frame permitted two poses, else 1
    std::uint32_t is_established; // non-zero: there was strong evidence for branch[0] since the branches last met
    double log_odds;  // log of P(branch[0] is the true one) / P(branch[1] is the true one), damped over time
    Motion branch[2]; // branch[0] is the chosen one
};

// Chooses among the poses of one frame (from estimate_poses; at least one). Returns the track for the next frame and
// the index of the chosen pose. The criteria are the reprojection errors of several frames and the continuity of the
// motion: each pose is the end of the most likely path (Viterbi's algorithm). Leaving an established branch requires
// strong evidence, because the errors of a single frame are often noise, and each switch is a visible flip. Where the
// branches meet, in a frontal view, the choice is open again. In the first frame, chooses the pose of smallest error.
// A track continues if at most 1 s has passed since its last frame.
struct Step {
    Track track;
    std::size_t chosen;
};
Step next_step(const Track &before, std::span<const Estimate> poses, std::int64_t capture_ns);

// Returns where the target is at `capture_ns` if it moves on at the same speed; nullopt if the track is too old.
std::optional<Motion> predicted_motion(const Track &track, std::int64_t capture_ns);

} // namespace arhost::pose
