// SPDX-License-Identifier: Apache-2.0
#include "worker/branches.hpp"

#include "pose/track.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>
#include <span>

namespace arhost::worker {
namespace {

using pose::Correspondence;
using pose::Estimate;
using pose::Rigid;
using pose::Track;

constexpr double corner_sigma_px = 0.1;   // of a sharp, well-lit marker
constexpr double max_difference_px = 0.5; // between the reported and the actual reprojection error

std::array<Correspondence, 4> corners_of(const arhost_marker &marker, double side_mm) {
    std::array<Correspondence, 4> corners;
    const auto on_marker_mm = pose::square_corners_mm(side_mm);
    for (int i = 0; i < 4; ++i)
        corners[i] = {on_marker_mm[i], {marker.corners_px[i][0], marker.corners_px[i][1]}, corner_sigma_px};
    return corners;
}

// The alternative as a minimum of the reprojection error: trackers refine only the better solution. Returns nullopt
// if there is no minimum near it, because the error then has a single minimum, that of the better solution.
std::optional<Estimate> refined_alternative(const arhost_marker &marker, std::span<const Correspondence> corners,
                                            const pose::Projection &projection) {
    constexpr double same_branch_rad = 0.1, distinct_rad = 0.02;
    if (std::ranges::all_of(marker.mt_alternative, [](double number) { return number == 0; }))
        return {};
    const Rigid reported = pose::rigid_of(marker.mt_alternative);
    auto refined = refine(reported, corners, projection);
    if (!refined ||
        !(pose::angle_between_rad(refined->camera_from_target.rotation, reported.rotation) < same_branch_rad) ||
        pose::angle_between_rad(refined->camera_from_target.rotation, pose::rigid_of(marker.mt).rotation) <
            distinct_rad)
        return {};
    return refined;
}

void exchange(arhost_marker &marker, const Estimate &alternative) {
    std::ranges::copy(marker.mt, marker.mt_alternative);
    std::ranges::copy(matrix_of(alternative.camera_from_target), marker.mt);
    marker.reprojection_px = alternative.reprojection_px;
    marker.ambiguity = 1; // the upper limit: the other solution has the smaller error
}

} // namespace

Branches::Branches(const arhost_intrinsics &intrinsics, std::vector<arhost_marker_config> markers)
    : projection_(intrinsics), markers_(std::move(markers)) {}

std::uint64_t Branches::state_size() const {
    return markers_.size() * sizeof(Track);
}

void Branches::choose(arhost_tracker_result &result, std::int64_t capture_ns, const void *before, void *after) const {
    if (before)
        std::memcpy(after, before, state_size());
    else
        std::memset(after, 0, state_size());
    const std::uint32_t count = std::min<std::uint32_t>(result.marker_count, ARHOST_MAX_MARKERS);
    for (arhost_marker &marker : std::span(result.markers, count)) {
        const auto listed = std::ranges::find(markers_, marker.id, &arhost_marker_config::id);
        if (listed == markers_.end() || marker.state != ARHOST_MARKER_DETECTED)
            continue;
        const auto corners = corners_of(marker, listed->side_mm);
        const auto reported = assess(pose::rigid_of(marker.mt), corners, projection_);
        if (!reported || !(std::abs(reported->reprojection_px - marker.reprojection_px) < max_difference_px))
            continue; // its corners are not those of its pose
        std::vector<Estimate> poses{*reported};
        if (const auto alternative = refined_alternative(marker, corners, projection_))
            poses.push_back(*alternative);
        std::byte *const slot = static_cast<std::byte *>(after) + (listed - markers_.begin()) * sizeof(Track);
        Track track;
        std::memcpy(&track, slot, sizeof track);
        const pose::Step step = next_step(track, poses, capture_ns);
        std::memcpy(slot, &step.track, sizeof step.track);
        if (step.chosen == 1)
            exchange(marker, poses[1]);
    }
}

} // namespace arhost::worker
