// SPDX-License-Identifier: Apache-2.0
#include "pose/track.hpp"
#include "worker/branches.hpp"

#include "simulated_markers.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <memory>

namespace arhost::worker {
namespace {

using namespace pose;

constexpr double side_mm = 80;
constexpr std::int64_t frame_ns = 33'333'333;
const arhost_intrinsics pinhole = intrinsics_of(ARHOST_DISTORTION_NONE, {});

// The report of a tracker that uses only the current frame.
arhost_marker report(Camera &camera, const Rigid &truth, double noise_px = 0.1, std::int32_t id = 5) {
    const ObservedMarker seen = camera.observe(truth, square_corners_mm(side_mm), noise_px);
    const auto poses = estimate_poses({&seen, 1}, camera.projection());
    arhost_marker marker{};
    marker.struct_size = sizeof marker;
    marker.id = id;
    marker.state = ARHOST_MARKER_DETECTED;
    for (int i = 0; i < 4; ++i) {
        marker.corners_px[i][0] = seen.corners_px[i].x();
        marker.corners_px[i][1] = seen.corners_px[i].y();
    }
    std::ranges::copy(matrix_of(poses.at(0).camera_from_target), marker.mt);
    marker.reprojection_px = poses[0].reprojection_px;
    if (poses.size() > 1) {
        std::ranges::copy(matrix_of(poses[1].camera_from_target), marker.mt_alternative);
        marker.ambiguity = poses[0].reprojection_px / poses[1].reprojection_px;
    }
    return marker;
}

bool is_right(const arhost_marker &marker, const Rigid &truth) {
    return degrees_between(rigid_of(marker.mt), truth) < 20;
}

class BranchesTest : public testing::Test {
protected:
    BranchesTest()
        : branches(pinhole, {{sizeof(arhost_marker_config), 3, 40}, {sizeof(arhost_marker_config), 5, side_mm}}),
          before(branches.state_size()), after(branches.state_size()) {}

    // Returns the record after the choice; keeps the state for the next call.
    arhost_marker choose(const arhost_marker &marker, std::int64_t capture_ns) {
        auto result = std::make_unique<arhost_tracker_result>();
        result->marker_count = 1;
        result->markers[0] = marker;
        branches.choose(*result, capture_ns, is_first ? nullptr : before.data(), after.data());
        before.swap(after);
        is_first = false;
        return result->markers[0];
    }

    Branches branches;
    std::vector<std::byte> before, after;
    bool is_first = true;
};

} // namespace

TEST_F(BranchesTest, APoseDoesNotFlipDuring3000FramesOfMotion) {
    int flips = 0, flips_of_tracker = 0;
    for (int run = 0; run < 3; ++run) {
        Camera camera(pinhole, static_cast<std::uint32_t>(run + 1));
        is_first = true;
        bool was_right = false, tracker_was_right = false;
        for (int frame = 0; frame < 1000; ++frame) {
            const Rigid truth = on_path(frame / 30.0, 0.7 * run, side_mm);
            const arhost_marker reported = report(camera, truth);
            const arhost_marker chosen = choose(reported, frame * frame_ns);
            flips += was_right && !is_right(chosen, truth);
            flips_of_tracker += tracker_was_right && !is_right(reported, truth);
            was_right = is_right(chosen, truth);
            tracker_was_right = is_right(reported, truth);
        }
    }
    EXPECT_EQ(flips, 0);
    EXPECT_GT(flips_of_tracker, 10) << "the motion must be a challenge";
}

TEST_F(BranchesTest, AnExchangedRecordIsConsistent) {
    Camera camera(pinhole, 2);
    int exchanged = 0;
    for (int frame = 0; frame < 2000 && exchanged < 5; ++frame) {
        const arhost_marker reported = report(camera, on_path(frame / 30.0, 0, side_mm));
        const arhost_marker chosen = choose(reported, frame * frame_ns);
        if (std::equal(chosen.mt, chosen.mt + 16, reported.mt)) {
            EXPECT_EQ(std::memcmp(&chosen, &reported, sizeof chosen), 0)
                << "a record of the right branch is untouched";
            continue;
        }
        ++exchanged;
        EXPECT_TRUE(std::equal(reported.mt, reported.mt + 16, chosen.mt_alternative));
        EXPECT_GE(chosen.reprojection_px, reported.reprojection_px);
        EXPECT_EQ(chosen.ambiguity, 1);
        double squares = 0;
        for (int i = 0; i < 4; ++i)
            squares += (*camera.projection().pixel(rigid_of(chosen.mt) * square_corners_mm(side_mm)[i]) -
                        Eigen::Vector2d(chosen.corners_px[i]))
                           .squaredNorm();
        EXPECT_NEAR(chosen.reprojection_px, std::sqrt(squares / 4), 1e-9);
    }
    EXPECT_EQ(exchanged, 5);
}

TEST_F(BranchesTest, RecordsThatAreNoMeasurementsAreUntouched) {
    Camera camera(pinhole, 3);
    const Rigid truth = pose_at({0, 0, 1500}, 30);
    choose(report(camera, truth), 0);
    const std::vector<std::byte> state = before;
    arhost_marker smoothed = report(camera, truth), elsewhere = smoothed, unlisted = smoothed, invalid = smoothed;
    smoothed.state = ARHOST_MARKER_PREDICTED;
    elsewhere.mt[14] = 500; // behind the camera
    unlisted.id = 4;
    invalid.mt[0] = std::nan("");
    for (const arhost_marker &marker : {smoothed, elsewhere, unlisted, invalid}) {
        const arhost_marker chosen = choose(marker, frame_ns);
        EXPECT_EQ(std::memcmp(&chosen, &marker, sizeof chosen), 0);
        EXPECT_EQ(before, state) << "the state is that of the last measurement";
    }
}

TEST_F(BranchesTest, TheStateOfAFrameWithoutMarkersIsThatBefore) {
    Camera camera(pinhole, 4);
    choose(report(camera, pose_at({0, 0, 1500}, 30)), 0);
    auto nothing = std::make_unique<arhost_tracker_result>();
    branches.choose(*nothing, frame_ns, before.data(), after.data());
    EXPECT_EQ(after, before);
    branches.choose(*nothing, frame_ns, nullptr, after.data());
    EXPECT_EQ(after, std::vector<std::byte>(branches.state_size()));
}

TEST_F(BranchesTest, SurvivesAStateOfArbitraryBytes) {
    Camera camera(pinhole, 5);
    std::mt19937 random(6);
    is_first = false;
    for (int round = 0; round < 400; ++round) {
        for (std::byte &byte : before)
            byte = static_cast<std::byte>(random());
        for (std::size_t at = 0; at < before.size() && round % 2; at += sizeof(Track)) { // a valid head
            Track track;
            std::memcpy(&track, &before[at], sizeof track);
            track.capture_ns = 0;
            track.branches = 1 + round / 2 % 2;
            if (round % 3 == 0)
                track.log_odds = std::nan("");
            std::memcpy(&before[at], &track, sizeof track);
        }
        const arhost_marker reported = report(camera, pose_at({0, 0, 1500}, 30));
        const arhost_marker chosen = choose(reported, frame_ns);
        EXPECT_EQ(chosen.id, reported.id);
    }
}

} // namespace arhost::worker
