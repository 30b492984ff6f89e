// SPDX-License-Identifier: Apache-2.0
//
// An adaptive low-pass filter for poses: strong while the target rests, weak while it moves.
#pragma once

#include "pose/estimate.hpp"

#include <cstdint>

namespace arhost::pose {

// The memory of one target. Plain data without pointers, because it is kept in shared memory across restarts; all
// zero if there is no earlier pose.
struct Smoothing {
    std::int64_t capture_ns; // capture time of the last pose
    double rotation[9], translation_mm[3];
    // Weighted sums of the innovations in units of the measurement noise, of their squared lengths, and of the
    // weights. The innovations of a resting target cancel out; those of a moving one point the same way.
    double innovations[6], squares, weights;
};

// Returns the filtered pose and updates the memory. A pose far from the last one, or more than 0.25 s later, is
// returned unchanged.
Rigid smoothed(Smoothing &memory, const Estimate &measured, std::int64_t capture_ns);

} // namespace arhost::pose
