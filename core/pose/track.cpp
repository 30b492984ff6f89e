// SPDX-License-Identifier: Apache-2.0
#include "pose/track.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace arhost::pose {
namespace {

constexpr double max_gap_s = 1;

// Returns the time since the last frame of a track; nullopt if this frame does not continue the track, or if the
// track has invalid bytes.
std::optional<double> seconds_since(const Track &track, std::int64_t capture_ns) {
    const double seconds = 1e-9 * (static_cast<double>(capture_ns) - static_cast<double>(track.capture_ns));
    const bool continues = (track.branches == 1 || track.branches == 2) && seconds >= 0 && seconds <= max_gap_s;
    return continues ? std::optional(seconds) : std::nullopt;
}

// Returns the log-likelihood of the errors, up to a constant. Uses Student's t-distribution, because most large
// errors are due to the model (lens, print), not to noise.
double log_likelihood(const Estimate &estimate) {
    constexpr double tail = 8;
    return -(tail + static_cast<double>(estimate.freedom)) / 2 * std::log1p(estimate.normalized_error / tail);
}

// Beyond this squared Mahalanobis distance, a rotation begins a new motion instead of continuing the old one.
constexpr double max_distance2 = 60;

// The branch from which a pose most likely follows, and the log-likelihood of this path. The likelihood is not
// normalized, so a branch whose motion is uncertain is not at a disadvantage.
struct Path {
    std::size_t branch;
    double log_likelihood;
};
Path best_path(std::span<const Motion> branches, double log_odds, const Estimate &pose) {
    const auto of_motion = [&](const Motion &motion) {
        return -std::min(rotation_distance2(motion, pose), max_distance2) / 2;
    };
    Path best{0, of_motion(branches[0])};
    if (branches.size() == 2) {
        const double second = of_motion(branches[1]) - log_odds;
        if (second > best.log_likelihood)
            best = {1, second};
    }
    return best;
}

} // namespace

Step next_step(const Track &before, std::span<const Estimate> poses, std::int64_t capture_ns) {
    // Evidence is damped and limited, because the errors of successive frames have common causes.
    constexpr double damping = 0.95, max_evidence = 8;
    // Less than max_distance2 / 2. Otherwise, a jump from the likelier branch could win over the continuation of the
    // other.
    constexpr double max_log_odds = 20;
    // Limits of the log-odds. The first: a branch becomes established. The others: the track leaves a branch when the
    // odds against it exceed the second limit (established branches) or the third (other branches).
    constexpr double established_log_odds = 10, switch_log_odds = 14, early_switch_log_odds = 2;
    // If the rotations of the branches differ by less, a switch is hardly visible and needs less evidence.
    constexpr double distinct_rad = 30 * std::numbers::pi / 180;

    std::array<Motion, 2> branches{};
    std::size_t known = 0;
    if (const auto seconds = seconds_since(before, capture_ns))
        for (; known < before.branches; ++known)
            branches[known] = predicted(before.branch[known], *seconds);

    Step step{{}, 0};
    Track &track = step.track;
    track.capture_ns = capture_ns;
    track.branches = poses.size() > 1 ? 2 : 1;
    const double log_odds_before = known == 2 ? std::min(damping * before.log_odds, max_log_odds) : 0;
    std::array<Path, 2> paths{};
    for (std::size_t i = 0; known > 0 && i < track.branches; ++i)
        paths[i] = best_path({branches.data(), known}, log_odds_before, poses[i]);
    if (poses.size() > 1) {
        const double evidence = log_likelihood(poses[0]) - log_likelihood(poses[1]),
                     log_odds = paths[0].log_likelihood - paths[1].log_likelihood +
                                std::clamp(evidence, -max_evidence, max_evidence); // log-odds for poses[0]
        // Where the branches meet, both poses may follow from the same branch.
        const bool is_fork = paths[0].branch == paths[1].branch, is_established = !is_fork && before.is_established;
        const double apart_rad =
            angle_between_rad(poses[0].camera_from_target.rotation, poses[1].camera_from_target.rotation);
        const double limit = is_fork ? 0
                                     : (is_established ? switch_log_odds : early_switch_log_odds) *
                                           std::min(apart_rad / distinct_rad, 1.0);
        const std::size_t first = paths[1].branch < paths[0].branch ? 1 : 0; // the pose that follows from branch[0]
        const bool switches = (first == 0 ? log_odds : -log_odds) < -limit;
        step.chosen = switches ? 1 - first : first;
        track.log_odds = step.chosen == 0 ? log_odds : -log_odds;
        track.is_established = track.log_odds > established_log_odds || (is_established && !switches);
    }
    for (std::uint32_t i = 0; i < track.branches; ++i) {
        const std::size_t pose = i == 0 ? step.chosen : 1 - step.chosen, last = paths[pose].branch;
        const bool continues = last < known && rotation_distance2(branches[last], poses[pose]) < max_distance2;
        track.branch[i] = continues ? corrected(branches[last], poses[pose]) : begin_motion(poses[pose]);
    }
    return step;
}

std::optional<Motion> predicted_motion(const Track &track, std::int64_t capture_ns) {
    const auto seconds = seconds_since(track, capture_ns);
    return seconds ? std::optional(predicted(track.branch[0], *seconds)) : std::nullopt;
}

} // namespace arhost::pose
