// SPDX-License-Identifier: Apache-2.0
#include "pose/track.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace arhost::pose {
namespace {

constexpr double max_gap_s = 1;

// The time since the last frame of a track; nullopt if it does not continue, or has invalid bytes.
std::optional<double> seconds_since(const Track &track, std::int64_t capture_ns) {
    const double seconds = 1e-9 * (static_cast<double>(capture_ns) - static_cast<double>(track.capture_ns));
    const bool continues = (track.branches == 1 || track.branches == 2) && seconds >= 0 && seconds <= max_gap_s;
    return continues ? std::optional(seconds) : std::nullopt;
}

// The log-likelihood of the errors, up to a constant. Student's t-distribution, because large errors are mostly those
// of the model (lens, print), not of the noise.
double log_likelihood(const Estimate &estimate) {
    constexpr double tail = 8;
    return -(tail + static_cast<double>(estimate.freedom)) / 2 * std::log1p(estimate.normalized_error / tail);
}

// Which of two poses continues branch[0], and the logarithm of the odds for this.
struct Continuation {
    std::size_t pose;
    double log_odds;
};
Continuation continuation(std::span<const Motion> branches, std::span<const Estimate> poses) {
    double straight = rotation_distance2(branches[0], poses[0]), crossed = rotation_distance2(branches[0], poses[1]);
    if (branches.size() == 2) {
        straight += rotation_distance2(branches[1], poses[1]);
        crossed += rotation_distance2(branches[1], poses[0]);
    }
    return {straight <= crossed ? 0U : 1U, std::min(std::abs(straight - crossed) / 2, 30.0)};
}

// Log-odds that branch[0] is the true one, from those before (`a`) and those that the branches were not exchanged
// since (`b`): P = P(a)·P(b) + (1 − P(a))·(1 − P(b)).
double combined_log_odds(double a, double b) {
    return std::log1p(std::exp(a + b)) - std::log(std::exp(a) + std::exp(b));
}

} // namespace

Step next_step(const Track &before, std::span<const Estimate> poses, std::int64_t capture_ns) {
    // Evidence is damped, because the errors of successive frames have common causes.
    constexpr double damping = 0.9, max_evidence = 4, switch_log_odds = 14;
    // A switch between branches that are closer is hardly visible and needs less evidence.
    constexpr double distinct_rad = 30 * std::numbers::pi / 180;
    // Squared distances from a predicted rotation: of another branch, and of another motion.
    constexpr double distinct_distance2 = 25, max_distance2 = 100;

    std::array<Motion, 2> branches{};
    std::size_t known = 0;
    if (const auto seconds = seconds_since(before, capture_ns))
        for (; known < before.branches; ++known)
            branches[known] = predicted(before.branch[known], *seconds);

    Step step{{}, 0};
    step.track.capture_ns = capture_ns;
    step.track.branches = poses.size() > 1 ? 2 : 1;
    // Whether branch[0] of the new track continues the second branch of the old one. A single pose does so if it is
    // clearly not on the first branch; where the branches meet, it is on both.
    bool switches = false;
    if (poses.size() == 1 && known == 2) {
        const double from_first = rotation_distance2(branches[0], poses[0]);
        switches = from_first > distinct_distance2 && rotation_distance2(branches[1], poses[0]) < from_first;
    }
    if (poses.size() > 1) {
        double log_odds = 0;
        if (known > 0) {
            const Continuation found = continuation({branches.data(), known}, poses);
            step.chosen = found.pose;
            if (known == 2) // where the branches meet, it is uncertain which is which afterwards
                log_odds = damping * combined_log_odds(before.log_odds, found.log_odds);
        }
        const double evidence = log_likelihood(poses[step.chosen]) - log_likelihood(poses[1 - step.chosen]);
        log_odds += std::clamp(evidence, -max_evidence, max_evidence);
        const double apart_rad =
            angle_between_rad(poses[0].camera_from_target.rotation, poses[1].camera_from_target.rotation);
        switches = log_odds < -switch_log_odds * std::min(apart_rad / distinct_rad, 1.0);
        if (switches)
            step.chosen = 1 - step.chosen;
        step.track.log_odds = switches ? -log_odds : log_odds;
    }
    for (std::uint32_t i = 0; i < step.track.branches; ++i) {
        const Estimate &pose = poses[i == 0 ? step.chosen : 1 - step.chosen];
        const std::uint32_t last = switches ? 1 - i : i;
        const bool continues = last < known && rotation_distance2(branches[last], pose) < max_distance2;
        step.track.branch[i] = continues ? corrected(branches[last], pose) : begin_motion(pose);
    }
    return step;
}

std::optional<Motion> predicted_motion(const Track &track, std::int64_t capture_ns) {
    const auto seconds = seconds_since(track, capture_ns);
    return seconds ? std::optional(predicted(track.branch[0], *seconds)) : std::nullopt;
}

} // namespace arhost::pose
