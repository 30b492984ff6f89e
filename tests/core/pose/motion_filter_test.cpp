// SPDX-License-Identifier: Apache-2.0
#include "pose/motion_filter.hpp"

#include "hand_held_marker.hpp"

namespace arhost::pose {
namespace {

constexpr double frame_s = 1 / 30.0;

} // namespace

TEST(MotionFilter, LagsLessThanAFrameBehindAHand) {
    Camera camera(pinhole, 5);
    Motion motion = begin_motion(measure(camera, in_hand(0)));
    std::vector<double> lags;
    for (int frame = 1; frame < 900; ++frame) {
        const double now = frame * frame_s;
        motion = corrected(predicted(motion, frame_s), measure(camera, in_hand(now)));
        add_lag(lags, camera, pose_of(motion), now);
    }
    expect_less_than_a_frame(lags);
}

TEST(MotionFilter, PredictsAtConstantVelocity) {
    const auto pose = [](double s) { return pose_at({100 * s, 0, 1000 - 50 * s}, 30, 0, 40 * s); };
    Estimate estimate{pose(0), 1e-6 * Matrix6d::Identity(), 0.1, 1, 0, 2};
    Motion motion = begin_motion(estimate);
    for (int frame = 1; frame < 60; ++frame) {
        estimate.camera_from_target = pose(frame * frame_s);
        motion = corrected(predicted(motion, frame_s), estimate);
    }
    const Rigid later = pose_of(predicted(motion, 0.1)), truth = pose(59 * frame_s + 0.1);
    EXPECT_LT(degrees_between(later, truth), 0.05);
    EXPECT_LT((later.translation_mm - truth.translation_mm).norm(), 0.05);
}

TEST(MotionFilter, AMeasuredRotationIsNearItsOwnMotionAndFarFromAnother) {
    Camera camera(pinhole, 6);
    const Rigid truth = pose_at({0, 0, 900}, 40);
    Motion motion = begin_motion(measure(camera, truth));
    double sum = 0;
    constexpr int frames = 300;
    for (int frame = 0; frame < frames; ++frame) {
        motion = predicted(motion, frame_s);
        const Estimate estimate = measure(camera, truth);
        sum += rotation_distance2(motion, estimate) / frames;
        motion = corrected(motion, estimate);
    }
    EXPECT_LT(sum, 4);
    Estimate other = measure(camera, pose_at({0, 0, 900}, -40));
    EXPECT_GT(rotation_distance2(motion, other), 100);
}

} // namespace arhost::pose
