// SPDX-License-Identifier: Apache-2.0
//
// The pose of a marker that a tracker has observed, computed as the worker does.
#pragma once

#include "tracker_support.hpp"

#include "pose/estimate.hpp"

#include <optional>

namespace arhost::test {

// A pose in the form of arhost_target.mt.
using Mt = std::array<double, 16>;

struct SolvedPose {
    Mt mt;
    double reprojection_px;
};

// Returns the pose of smallest error; std::nullopt if the corners are not those of a marker's front.
inline std::optional<SolvedPose> solved_pose(const arhost_observation &seen, const arhost_intrinsics &camera,
                                             double side_mm) {
    pose::ObservedMarker marker{pose::square_corners_mm(side_mm), {}, 0.1};
    for (int i = 0; i < 4; ++i)
        marker.corners_px[i] = Eigen::Vector2d(seen.corners_px[i]);
    const auto poses = estimate_poses({&marker, 1}, pose::Projection(camera));
    if (poses.empty())
        return std::nullopt;
    return SolvedPose{matrix_of(poses.front().camera_from_target), poses.front().reprojection_px};
}

} // namespace arhost::test
