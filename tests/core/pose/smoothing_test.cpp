// SPDX-License-Identifier: Apache-2.0
#include "pose/smoothing.hpp"

#include "hand_held_marker.hpp"

#include <cstring>
#include <limits>

namespace arhost::pose {
namespace {

constexpr std::int64_t frame_ns = 33'333'333;

const Rigid resting = pose_at({40, -30, 700}, 40, 20, 15);

// RMS deviation of a corner from its mean position.
double jitter_px(const std::vector<Eigen::Vector2d> &corners) {
    Eigen::Vector2d mean(0, 0);
    for (const Eigen::Vector2d &corner : corners)
        mean += corner / static_cast<double>(corners.size());
    double sum = 0;
    for (const Eigen::Vector2d &corner : corners)
        sum += (corner - mean).squaredNorm() / static_cast<double>(corners.size());
    return std::sqrt(sum);
}

// The noise of a detector may differ from what the covariance assumes.
TEST(Smoothing, HalvesTheJitterOfARestingMarkerWhateverTheNoise) {
    for (const double noise : {0.03, 0.1, 0.4}) {
        Camera camera(pinhole, 3);
        Smoothing memory{};
        std::vector<Eigen::Vector2d> before, after;
        for (int frame = 0; frame < 600; ++frame) {
            const Estimate measured = measure(camera, resting, noise);
            const Rigid pose = smoothed(memory, measured, frame * frame_ns);
            if (frame < 30)
                continue;
            before.push_back(corner_px(camera, measured.camera_from_target));
            after.push_back(corner_px(camera, pose));
        }
        EXPECT_LT(jitter_px(after), 0.5 * jitter_px(before)) << noise;
    }
}

TEST(Smoothing, LagsLessThanAFrameBehindAHand) {
    Camera camera(pinhole, 5);
    Smoothing memory{};
    std::vector<double> lags;
    for (int frame = 0; frame < 900; ++frame) {
        const double now = frame / 30.0;
        add_lag(lags, camera, smoothed(memory, measure(camera, in_hand(now)), frame * frame_ns), now);
    }
    expect_less_than_a_frame(lags);
}

TEST(Smoothing, FollowsAJumpAtOnce) {
    Camera camera(pinhole, 7);
    Smoothing memory{};
    const Rigid elsewhere = pose_at({80, 10, 650}, 30, 200, 60);
    for (int frame = 0; frame < 30; ++frame)
        smoothed(memory, measure(camera, resting), frame * frame_ns);
    const Estimate measured = measure(camera, elsewhere);
    const Rigid pose = smoothed(memory, measured, 30 * frame_ns);
    EXPECT_EQ(pose.translation_mm, measured.camera_from_target.translation_mm);
    EXPECT_EQ(pose.rotation, measured.camera_from_target.rotation);
}

TEST(Smoothing, BeginsAnewAfterAGapAndWithOlderFrames) {
    Camera camera(pinhole, 7);
    for (const std::int64_t time : {40 * frame_ns, 28 * frame_ns}) {
        Smoothing memory{};
        for (int frame = 0; frame < 30; ++frame)
            smoothed(memory, measure(camera, resting), frame * frame_ns);
        const Estimate measured = measure(camera, resting);
        EXPECT_EQ(smoothed(memory, measured, time).translation_mm, measured.camera_from_target.translation_mm);
    }
}

TEST(Smoothing, ReturnsRotationsForever) {
    Camera camera(pinhole, 9);
    Smoothing memory{};
    for (int frame = 0; frame < 3000; ++frame) {
        const Rigid pose = smoothed(memory, measure(camera, in_hand(frame / 30.0)), frame * frame_ns);
        ASSERT_TRUE((pose.rotation * pose.rotation.transpose()).isIdentity(1e-9)) << frame;
    }
}

TEST(Smoothing, IgnoresAMemoryOfOtherBytes) {
    Camera camera(pinhole, 9);
    Smoothing memory;
    std::memset(&memory, 0xff, sizeof memory);
    memory.capture_ns = 0;
    const Estimate measured = measure(camera, resting);
    EXPECT_EQ(smoothed(memory, measured, 1).translation_mm, measured.camera_from_target.translation_mm);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (const auto spoil : {+[](Smoothing &m, double value) { m.innovations[3] = value; },
                             +[](Smoothing &m, double value) { m.squares = value; },
                             +[](Smoothing &m, double value) { m.weights = value; },
                             +[](Smoothing &m, double value) { m.translation_mm[0] = value; }}) {
        memory = {};
        smoothed(memory, measured, 0);
        spoil(memory, nan);
        EXPECT_EQ(smoothed(memory, measured, 1).translation_mm, measured.camera_from_target.translation_mm);
    }
}

TEST(Smoothing, DependsOnlyOnMemoryAndPose) {
    Camera camera(pinhole, 11);
    Smoothing memory{};
    for (int frame = 0; frame < 10; ++frame)
        smoothed(memory, measure(camera, in_hand(frame / 30.0)), frame * frame_ns);
    const Estimate measured = measure(camera, in_hand(1.0 / 3));
    Smoothing a = memory, b = memory;
    EXPECT_EQ(smoothed(a, measured, 10 * frame_ns).rotation, smoothed(b, measured, 10 * frame_ns).rotation);
    EXPECT_EQ(std::memcmp(&a, &b, sizeof a), 0);
}

} // namespace
} // namespace arhost::pose
