// SPDX-License-Identifier: Apache-2.0
//
// A marker in a hand, for tests of filters.
#pragma once

#include "simulated_markers.hpp"

#include <algorithm>

namespace arhost::pose {

constexpr double side_mm = 80, noise_px = 0.1;
inline const arhost_intrinsics pinhole = intrinsics_of(ARHOST_DISTORTION_NONE, {});

// The estimate that is nearest to the truth: the choice between two is not tested here. `actual_noise_px`: that of
// the corners, for which the estimate assumes noise_px.
inline Estimate measure(Camera &camera, const Rigid &truth, double actual_noise_px = noise_px) {
    ObservedMarker marker = camera.observe(truth, square_corners_mm(side_mm), actual_noise_px);
    marker.corner_sigma_px = noise_px;
    const auto poses = estimate_poses({&marker, 1}, camera.projection());
    if (poses.empty())
        throw std::runtime_error("no pose");
    return *std::ranges::min_element(
        poses, {}, [&](const Estimate &pose) { return degrees_between(pose.camera_from_target, truth); });
}

inline Eigen::Vector2d corner_px(const Camera &camera, const Rigid &pose) {
    return *camera.projection().pixel(pose * square_corners_mm(side_mm)[1]);
}

// Its corner moves by up to 6 px from frame to frame.
inline Rigid in_hand(double seconds) {
    return pose_at({60 * std::sin(3 * seconds), 40 * std::sin(4 * seconds), 800 + 60 * std::sin(2 * seconds)},
                   35 + 15 * std::sin(2.5 * seconds), 30 * seconds, 40 * std::sin(seconds));
}

// Adds by how many frames of 1/30 s a found pose lags behind the hand, if the corner moves: otherwise, noise decides
// which earlier position is the nearest.
inline void add_lag(std::vector<double> &lags, const Camera &camera, const Rigid &found, double now_s) {
    const auto error_px = [&](double frames) {
        return (corner_px(camera, found) - corner_px(camera, in_hand(now_s - frames / 30))).norm();
    };
    double lag = 0;
    for (double frames = 0; frames <= 5; frames += 0.1)
        if (error_px(frames) < error_px(lag))
            lag = frames;
    if ((corner_px(camera, in_hand(now_s)) - corner_px(camera, in_hand(now_s - 1 / 30.0))).norm() > 1)
        lags.push_back(lag);
}
inline void expect_less_than_a_frame(std::vector<double> lags) {
    ASSERT_GT(lags.size(), 300u);
    std::ranges::sort(lags);
    EXPECT_LE(lags[lags.size() * 95 / 100], 1);
}

} // namespace arhost::pose
