// SPDX-License-Identifier: Apache-2.0
#include "pose/track.hpp"
#include "worker/target_solver.hpp"

#include "simulated_markers.hpp"

#include <gmock/gmock.h>

#include <cstring>
#include <optional>

namespace arhost::worker {
namespace {

using namespace pose;
using testing::HasSubstr;

constexpr double side_mm = 80;
constexpr std::uint32_t full_search_every = 6;
constexpr std::int64_t frame_ns = 33'333'333;
constexpr double small_family = 6e-5; // the false positive rate of tag16h5
const arhost_intrinsics pinhole = intrinsics_of(ARHOST_DISTORTION_NONE, {});

using Corners = std::array<Eigen::Vector3d, 4>;

model::TargetMarker configured(std::int32_t id, const Corners &corners, const char *family = "tag36h11") {
    model::TargetMarker marker{id, family, {}};
    for (std::size_t i = 0; i < 4; ++i)
        marker.corners_mm[i] = {corners[i].x(), corners[i].y(), corners[i].z()};
    return marker;
}

// Markers 10 to 13 around the origin of the target, with gaps of half of their side.
Corners on_board(std::int32_t id) {
    const double x = id % 2 ? 0.75 : -0.75, y = id < 12 ? 0.75 : -0.75;
    return square_at({Eigen::Matrix3d::Identity(), {x * side_mm, y * side_mm, 0}}, side_mm);
}

const Corners single = square_corners_mm(side_mm);
const std::vector<model::Target> targets = {
    {"cup", {configured(5, single)}, ""},
    {"board",
     {configured(10, on_board(10)), configured(11, on_board(11)), configured(12, on_board(12)),
      configured(13, on_board(13))},
     ""},
    {"box", {configured(5, single, "DICT_4X4_50")}, ""},
    {"head", {}, "skull"},
};
enum Index { cup, board, box, head };

arhost_observation observed(const ObservedMarker &seen, std::int32_t id, std::uint32_t family = 0,
                            double margin = 1) {
    arhost_observation observation{sizeof observation, id, family, 0, {}, margin, 0, 0, {}};
    for (int i = 0; i < 4; ++i) {
        observation.corners_px[i][0] = seen.corners_px[i].x();
        observation.corners_px[i][1] = seen.corners_px[i].y();
    }
    return observation;
}

class TargetSolverTest : public testing::Test {
protected:
    TargetSolverTest() { use({full_search_every}); }

    // Continues with another solver, without a state.
    void use(const TargetSolver::Settings &settings) {
        solver.emplace(pinhole, targets, settings);
        before.assign(solver->state_size(), {});
        after = before;
        is_first = true;
    }

    arhost_observation see(const Rigid &truth, std::int32_t id, const Corners &corners = single, double noise_px = 0,
                           std::uint32_t family = 0, double margin = 1) {
        return observed(camera.observe(truth, corners, noise_px), id, family, margin);
    }
    // A marker of tag16h5 without corrected bits may be seen by chance.
    arhost_observation doubtful(const Rigid &truth, std::int32_t id = 5, const Corners &corners = single) {
        arhost_observation observation = see(truth, id, corners);
        observation.false_positive_rate = small_family;
        return observation;
    }
    std::vector<arhost_observation> see_board(const Rigid &truth, double noise_px = 0) {
        std::vector<arhost_observation> seen;
        for (const std::int32_t id : {10, 11, 12, 13})
            seen.push_back(see(truth, id, on_board(id), noise_px));
        return seen;
    }
    // Keeps the state for the next call.
    void solve(std::vector<arhost_observation> seen, std::int64_t frame = 0,
               std::vector<arhost_body_pose> poses = {}) {
        arhost_tracker_result result{};
        result.observations = seen.data();
        result.observation_count = static_cast<std::uint32_t>(seen.size());
        result.poses = poses.data();
        result.pose_count = static_cast<std::uint32_t>(poses.size());
        observations.assign(seen.size(), {});
        const void *const known = is_first ? nullptr : before.data();
        expectation = solver->expect(frame * frame_ns, known);
        solver->solve(result, expectation.search_everywhere, frame * frame_ns, known, after.data(),
                      {solved, observations});
        missed = solver->move_missed_to_end(expectation, result);
        before.swap(after);
        is_first = false;
    }
    std::string violation(std::vector<arhost_observation> seen, std::vector<arhost_body_pose> poses = {}) {
        try {
            solve(std::move(seen), 0, std::move(poses));
            return "";
        } catch (const std::runtime_error &error) {
            return error.what();
        }
    }
    Rigid pose_of(Index index) const { return rigid_of(solved[index].mt); }

    std::optional<TargetSolver> solver;
    Camera camera{pinhole, 1};
    std::vector<std::byte> before, after;
    bool is_first = true;
    std::array<arhost_target, 4> solved{};
    TargetSolver::Expectation expectation; // before the last frame
    std::uint32_t missed = 0;              // of it
    std::vector<arhost_observation> observations;
};

void expect_near(const Rigid &pose, const Rigid &truth, double mm = 1e-3, double degrees = 1e-3) {
    EXPECT_LT((pose.translation_mm - truth.translation_mm).norm(), mm);
    EXPECT_LT(degrees_between(pose, truth), degrees);
}

arhost_body_pose body_pose(std::uint32_t target) {
    arhost_body_pose pose{sizeof pose, target, ARHOST_TARGET_DETECTED, 0, {}, {}};
    std::ranges::copy(matrix_of(pose_at({1, 2, 700}, 20)), pose.mt);
    pose.covariance[0] = 4;
    return pose;
}

} // namespace

TEST_F(TargetSolverTest, ComputesThePoseOfAMarkerAndOfAMap) {
    const Rigid cup_truth = pose_at({-100, 50, 900}, 35), board_truth = pose_at({100, -50, 1200}, 50, 30);
    std::vector<arhost_observation> seen = see_board(board_truth);
    seen.insert(seen.begin() + 2, see(cup_truth, 5));
    seen.push_back(see(cup_truth, 77)); // of no target
    solve(seen);
    EXPECT_EQ(solved[cup].state, ARHOST_TARGET_DETECTED);
    EXPECT_EQ(solved[board].state, ARHOST_TARGET_DETECTED);
    EXPECT_EQ(solved[box].state, 0) << "never seen";
    expect_near(pose_of(cup), cup_truth);
    expect_near(pose_of(board), board_truth);
    EXPECT_LT(solved[board].reprojection_px, 1e-3);
    // The observations of a target adjoin; those of no target are the last ones.
    EXPECT_EQ(solved[cup].first_observation, 0u);
    EXPECT_EQ(solved[cup].observation_count, 1u);
    EXPECT_EQ(solved[board].first_observation, 1u);
    EXPECT_EQ(solved[board].observation_count, 4u);
    std::vector<std::int32_t> ids;
    for (const arhost_observation &observation : observations)
        ids.push_back(observation.id);
    EXPECT_EQ(ids, (std::vector{5, 10, 11, 12, 13, 77}));
}

TEST_F(TargetSolverTest, ProjectsTheCornersOfTargetsWithTheirPoses) {
    const Rigid cup_truth = pose_at({-100, 50, 900}, 35), board_truth = pose_at({100, -50, 1200}, 50, 30);
    std::vector<arhost_observation> seen = see_board(board_truth);
    seen[1].corners_px[2][0] += 3; // an outlier
    seen.push_back(see(cup_truth, 5));
    seen.push_back(see(cup_truth, 77)); // of no target
    seen.back().projected_px[0][0] = 1; // written by the tracker
    solve(seen);
    const Projection projection(pinhole);
    for (std::size_t i = 0; i < 5; ++i) {
        const arhost_observation &seen_again = observations[i];
        const Corners corners = seen_again.id == 5 ? single : on_board(seen_again.id);
        for (std::size_t corner = 0; corner < 4; ++corner) {
            const auto expected =
                projection.pixel((seen_again.id == 5 ? cup_truth : board_truth) * corners.at(corner)).value();
            EXPECT_NEAR(seen_again.projected_px[corner][0], expected.x(), 0.02) << i;
            EXPECT_NEAR(seen_again.projected_px[corner][1], expected.y(), 0.02) << i;
        }
    }
    EXPECT_EQ(observations[5].id, 77);
    for (const auto &corner : observations[5].projected_px)
        EXPECT_TRUE(corner[0] == 0 && corner[1] == 0);
}

TEST_F(TargetSolverTest, CountsExpectedMarkersThatTheTrackerMisses) {
    const Rigid cup_truth = pose_at({-100, 50, 900}, 35), board_truth = pose_at({100, -50, 1200}, 50, 30);
    std::vector<arhost_observation> seen = see_board(board_truth);
    seen.push_back(see(cup_truth, 5));
    solve(seen);
    EXPECT_TRUE(expectation.search_everywhere);
    EXPECT_EQ(missed, 0u);
    seen.erase(seen.begin() + 1);
    seen.push_back(see(cup_truth, 77));
    solve(seen, 1);
    EXPECT_FALSE(expectation.search_everywhere);
    ASSERT_EQ(expectation.markers.size(), 5u);
    EXPECT_EQ(missed, 1u);
    EXPECT_EQ(expectation.markers.back().marker, 2u) << "the marker 11 is the third one of the setup";
}

TEST_F(TargetSolverTest, TellsTheSameIdOfTwoFamiliesApart) {
    const Rigid left = pose_at({-150, 0, 900}, 30), right = pose_at({150, 0, 900}, 40);
    solve({see(left, 5, single, 0, 1), see(right, 5)});
    expect_near(pose_of(box), left);
    expect_near(pose_of(cup), right);
}

TEST_F(TargetSolverTest, CovariancesAreThoseOfTheErrors) {
    const Rigid truth = pose_at({50, 20, 1000}, 40);
    const int count = 400;
    for (const auto &[noise_px, told_px] :
         {std::pair(0.02, 0.02), {0.1, 0.1}, {0.3, 0.3}, {0.3, 0.0}}) { // 0: the solver assumes 0.3
        double mahalanobis2 = 0;
        for (int i = 0; i < count; ++i) {
            is_first = true;
            arhost_observation seen = see(truth, 5, single, noise_px);
            seen.corner_sigma_px = told_px;
            solve({seen});
            // The difference to the truth in the axes of `mt`.
            const Eigen::Vector3d to_gl(1, -1, -1);
            Eigen::Matrix<double, 6, 1> error;
            error << to_gl.cwiseProduct(truth.translation_mm - pose_of(cup).translation_mm),
                to_gl.cwiseProduct(rotation_vector(truth.rotation * pose_of(cup).rotation.transpose()));
            const Eigen::Map<const Matrix6d> covariance(solved[cup].covariance);
            if (degrees_between(pose_of(cup), truth) < 20) // not the other branch
                mahalanobis2 += error.dot(covariance.ldlt().solve(error));
        }
        // The mean of the chi-square distribution with 6 degrees of freedom.
        EXPECT_NEAR(mahalanobis2 / count, 6, 1) << noise_px << " " << told_px;
    }
}

TEST_F(TargetSolverTest, APoseDoesNotFlipDuring3000FramesOfMotion) {
    int flips = 0, flips_of_single_frames = 0;
    for (int run = 0; run < 3; ++run) {
        camera = Camera(pinhole, static_cast<std::uint32_t>(run + 1));
        is_first = true;
        bool was_right = false, single_was_right = false;
        for (int frame = 0; frame < 1000; ++frame) {
            const Rigid truth = on_path(frame / 30.0, 0.7 * run, side_mm);
            const ObservedMarker seen = camera.observe(truth, single, 0.1);
            solve({observed(seen, 5)}, frame);
            const auto is_right = [&](const Rigid &pose) { return degrees_between(pose, truth) < 20; };
            const bool single_is_right =
                is_right(estimate_poses({&seen, 1}, camera.projection()).at(0).camera_from_target);
            flips += was_right && !is_right(pose_of(cup));
            flips_of_single_frames += single_was_right && !single_is_right;
            was_right = is_right(pose_of(cup));
            single_was_right = single_is_right;
        }
    }
    EXPECT_EQ(flips, 0);
    EXPECT_GT(flips_of_single_frames, 10) << "the motion must be a challenge";
}

TEST_F(TargetSolverTest, ReportsTheOtherSolution) {
    bool has_exchanged = false;
    for (int frame = 0; frame < 1000; ++frame) {
        solve({see(on_path(frame / 30.0, 0, side_mm), 5, single, 0.1)}, frame);
        const arhost_target &target = solved[cup];
        ASSERT_GE(target.ambiguity, 0);
        ASSERT_LE(target.ambiguity, 1);
        const bool has_alternative = target.mt_alternative[15] == 1;
        ASSERT_EQ(target.ambiguity > 0, has_alternative);
        if (has_alternative) {
            ASSERT_GT(degrees_between(rigid_of(target.mt_alternative), pose_of(cup)), 1);
        }
        has_exchanged |= target.ambiguity == 1;
    }
    EXPECT_TRUE(has_exchanged) << "at least once, the true pose has the larger error";
}

TEST_F(TargetSolverTest, CountsTheFramesSinceATargetWasLost) {
    const Rigid truth = pose_at({0, 0, 900}, 30);
    solve({});
    EXPECT_EQ(solved[cup].state, 0);
    solve({see(truth, 5)}, 1);
    EXPECT_EQ(solved[cup].age_frames, 0u);
    const arhost_target seen = solved[cup];
    for (std::uint32_t age = 1; age < 4; ++age) {
        solve({}, 1 + age);
        EXPECT_EQ(solved[cup].state, ARHOST_TARGET_LOST);
        EXPECT_EQ(solved[cup].age_frames, age);
        EXPECT_TRUE(std::ranges::equal(solved[cup].mt, seen.mt)) << "the last known pose";
        EXPECT_EQ(solved[cup].reprojection_px, 0);
    }
    arhost_observation mirrored = see(truth, 5);
    std::swap(mirrored.corners_px[1], mirrored.corners_px[3]);
    solve({mirrored}, 5);
    EXPECT_EQ(solved[cup].state, ARHOST_TARGET_LOST) << "no pose shows the front of a marker at these corners";
    solve({see(truth, 5)}, 6);
    EXPECT_EQ(solved[cup].state, ARHOST_TARGET_DETECTED);
    EXPECT_EQ(solved[cup].age_frames, 0u);
}

TEST_F(TargetSolverTest, IgnoresAMarkerWithACornerElsewhere) {
    arhost_observation hidden = see(pose_at({0, 0, 900}, 30), 5);
    const double side_px = std::hypot(hidden.corners_px[1][0] - hidden.corners_px[0][0],
                                      hidden.corners_px[1][1] - hidden.corners_px[0][1]);
    hidden.corners_px[2][0] -= 0.4 * side_px;
    hidden.corners_px[2][1] -= 0.3 * side_px;
    solve({hidden});
    EXPECT_EQ(solved[cup].state, 0);
    EXPECT_EQ(solved[cup].observation_count, 1u) << "it is reported nevertheless";
    // The other markers of a map tell which corner is wrong.
    const Rigid truth = pose_at({0, 0, 1200}, 30);
    std::vector<arhost_observation> seen = see_board(truth);
    seen[1].corners_px[2][0] -= 20;
    solve(seen);
    expect_near(pose_of(board), truth);
}

TEST_F(TargetSolverTest, OfSeveralCopiesTakesTheOneThatContinuesTheMotion) {
    const Rigid here = pose_at({-100, 0, 900}, 30), elsewhere = pose_at({150, 0, 900}, 30);
    solve({see(here, 5)});
    solve({see(elsewhere, 5, single, 0, 0, 9), see(here, 5)}, 1);
    expect_near(pose_of(cup), here);
    EXPECT_EQ(solved[cup].observation_count, 2u) << "all copies are reported";
    is_first = true;
    std::vector<arhost_observation> seen = {see(here, 5), see(elsewhere, 5, single, 0, 0, 9)};
    solve(seen);
    expect_near(pose_of(cup), elsewhere); // without a motion, that which was read more clearly
    is_first = true;
    seen[1].hamming = 1;
    solve(seen);
    expect_near(pose_of(cup), here); // or that without corrected bits
}

TEST_F(TargetSolverTest, OfSeveralCopiesTakesTheOneThatFitsToTheOtherMarkersOfTheMap) {
    const Rigid truth = pose_at({0, 0, 1200}, 40);
    std::vector<arhost_observation> seen = see_board(truth);
    seen.push_back(see(pose_at({250, 100, 1100}, 10), 12, single, 0, 0, 9));
    solve(seen);
    expect_near(pose_of(board), truth);
    EXPECT_LT(solved[board].reprojection_px, 1e-3);
    EXPECT_EQ(solved[board].observation_count, 5u);
}

TEST_F(TargetSolverTest, PassesThePosesOfBodies) {
    const arhost_body_pose pose = body_pose(head);
    solve({}, 0, {pose});
    EXPECT_EQ(solved[head].state, ARHOST_TARGET_DETECTED);
    EXPECT_TRUE(std::ranges::equal(solved[head].mt, pose.mt));
    EXPECT_TRUE(std::ranges::equal(solved[head].covariance, pose.covariance));
    EXPECT_EQ(solved[cup].state, 0);
    solve({}, 1);
    EXPECT_EQ(solved[head].state, ARHOST_TARGET_LOST);
    EXPECT_EQ(solved[head].age_frames, 1u);
    EXPECT_TRUE(std::ranges::equal(solved[head].mt, pose.mt));
    arhost_body_pose imprecise = pose;
    imprecise.mt[0] += 2e-7;
    solve({}, 1, {imprecise});
    const Eigen::Matrix3d rotation = pose_of(head).rotation;
    EXPECT_TRUE((rotation * rotation.transpose()).isIdentity(1e-12));
    arhost_body_pose extrapolated = pose;
    extrapolated.state = ARHOST_TARGET_PREDICTED;
    extrapolated.age_frames = 2;
    solve({}, 2, {extrapolated});
    EXPECT_EQ(solved[head].state, ARHOST_TARGET_PREDICTED);
    EXPECT_EQ(solved[head].age_frames, 2u);
    solve({}, 3);
    EXPECT_EQ(solved[head].age_frames, 3u);
}

TEST_F(TargetSolverTest, ExpectsMarkersWhereTheirTargetsMove) {
    int outside = 0;
    for (int frame = 0; frame < 300; ++frame) {
        const Rigid truth = on_path(frame / 30.0, 0, 3 * side_mm);
        std::vector<arhost_observation> seen = see_board(truth, 0.1);
        seen.pop_back(); // one marker is hidden, but expected
        solve(seen, frame);
        ASSERT_EQ(expectation.markers.size(), frame == 0 ? 0u : 4u) << frame;
        for (std::size_t i = 0; i < expectation.markers.size(); ++i) {
            const arhost_expected_marker &expected = expectation.markers[i];
            ASSERT_EQ(expected.marker, 1 + i) << "index among the markers of all targets";
            const arhost_observation marker = see(truth, 0, on_board(10 + static_cast<std::int32_t>(i)));
            for (int corner = 0; corner < 4; ++corner)
                outside +=
                    !(std::hypot(marker.corners_px[corner][0] - expected.corners_px[corner][0],
                                 marker.corners_px[corner][1] - expected.corners_px[corner][1]) < expected.margin_px);
            if (frame > 10) {
                ASSERT_LT(expected.margin_px, 60);
            }
        }
    }
    EXPECT_EQ(outside, 0);
}

TEST_F(TargetSolverTest, RequestsAFullSearchFirstAtIntervalsAndAfterALoss) {
    const Rigid truth = pose_at({0, 0, 900}, 30);
    std::vector<bool> full;
    for (int frame = 0; frame < 20; ++frame) {
        solve(frame == 8 || frame == 9 ? std::vector<arhost_observation>() : std::vector{see(truth, 5)}, frame);
        full.push_back(expectation.search_everywhere);
    }
    const std::vector<bool> expected = {true, false, false, false, false, false, true, false, false, true,
                                        true, false, false, false, false, false, true, false, false, false};
    EXPECT_EQ(full, expected) << "lost in frame 8, found again in frame 10";
    const TargetSolver always(pinhole, targets, {1});
    EXPECT_TRUE(always.expect(20 * frame_ns, before.data()).search_everywhere);
}

TEST_F(TargetSolverTest, FiltersPosesOnRequest) {
    const Rigid truth = pose_at({20, 10, 900}, 30);
    const auto jitter_mm = [&](bool smooth) {
        use({full_search_every, smooth});
        camera = Camera(pinhole, 4);
        double sum = 0;
        for (int frame = 0; frame < 300; ++frame) {
            solve({see(truth, 5, single, 0.1)}, frame);
            EXPECT_EQ(solved[cup].state, ARHOST_TARGET_DETECTED);
            if (frame >= 30)
                sum += (pose_of(cup).translation_mm - truth.translation_mm).squaredNorm();
        }
        return std::sqrt(sum / 270);
    };
    EXPECT_LT(jitter_mm(true), 0.6 * jitter_mm(false));
}

TEST_F(TargetSolverTest, ReportsAMarkerThatMayBeChanceInTheSecondFrame) {
    const Rigid truth = pose_at({20, 10, 900}, 30);
    solve({doubtful(truth)});
    EXPECT_EQ(solved[cup].state, 0) << "it may be chance";
    EXPECT_EQ(solved[cup].observation_count, 1u);
    solve({doubtful(truth)}, 1);
    ASSERT_EQ(expectation.markers.size(), 1u) << "it is searched there, too";
    EXPECT_EQ(solved[cup].state, ARHOST_TARGET_DETECTED);
    expect_near(pose_of(cup), truth);
    solve({}, 2);
    EXPECT_EQ(solved[cup].state, ARHOST_TARGET_LOST);
    solve({doubtful(truth)}, 3);
    EXPECT_EQ(solved[cup].state, ARHOST_TARGET_DETECTED) << "it is where it was";
    solve({}, 4);
    solve({doubtful(pose_at({-200, 10, 900}, 30))}, 5);
    EXPECT_EQ(solved[cup].state, ARHOST_TARGET_LOST) << "it jumped";
    EXPECT_EQ(solved[cup].age_frames, 2u);
    expect_near(pose_of(cup), truth);
    solve({doubtful(truth)}, 6);
    EXPECT_EQ(solved[cup].state, ARHOST_TARGET_LOST) << "it jumped back";
    solve({doubtful(truth)}, 7);
    EXPECT_EQ(solved[cup].state, ARHOST_TARGET_DETECTED);
}

TEST_F(TargetSolverTest, AConfirmedMarkerKeepsItsPoseAfterAStepThatItsMotionDoesNotPredict) {
    for (const double step_px : {4.5, 6.0, 20.0, 40.0}) {
        SCOPED_TRACE(step_px);
        is_first = true;
        for (int frame = 0; frame < 40; ++frame) {
            // Rests, is pushed, and then shakes.
            const double steps = frame < 20 ? 0 : frame < 30 ? 1 : frame % 2;
            arhost_observation seen = doubtful(pose_at({20 + steps * step_px * 900 / pinhole.fx, 10, 900}, 30));
            if (frame > 5 && frame % 3 == 0)
                seen.false_positive_rate = 1; // no evidence, but of a confirmed target
            solve({seen}, frame);
            if (frame > 1) {
                ASSERT_EQ(solved[cup].state, ARHOST_TARGET_DETECTED) << frame;
            }
        }
    }
}

TEST_F(TargetSolverTest, AStepHalvesTheEvidenceOfAMarkerThatIsNotConfirmed) {
    const auto frames_needed = [&](double step_mm) {
        arhost_observation seen;
        is_first = true;
        solved = {};
        int frame = 0;
        for (; frame < 20 && solved[cup].state != ARHOST_TARGET_DETECTED; ++frame) {
            seen = see(pose_at({20 + (frame >= 4 ? step_mm : 0), 10, 900}, 30), 5);
            seen.false_positive_rate = 0.1;
            solve({seen}, frame);
        }
        return frame;
    };
    const int without = frames_needed(0), with = frames_needed(20), jumped = frames_needed(200);
    EXPECT_LT(without, with);
    EXPECT_LT(with, jumped);
}

TEST_F(TargetSolverTest, ForgetsAMarkerThatMayBeChanceAfterAGap) {
    const arhost_observation seen = doubtful(pose_at({20, 10, 900}, 30));
    solve({seen});
    solve({}, 1);
    solve({seen}, 2);
    EXPECT_EQ(solved[cup].state, 0);
    solve({seen}, 3);
    EXPECT_EQ(solved[cup].state, ARHOST_TARGET_DETECTED);
}

TEST_F(TargetSolverTest, CountsTheListedMarkersAgainAfterAGap) {
    arhost_observation seen = see(pose_at({20, 10, 900}, 30), 5);
    seen.false_positive_rate = 3e-8; // of one of five listed markers: 1.5e-7
    solve({seen});
    solve({}, 1);
    solve({seen}, 2);
    EXPECT_EQ(solved[cup].state, 0);
}

TEST_F(TargetSolverTest, WithoutConfirmationAJumpKeepsTheBranch) {
    const auto branches_after_a_jump = [&](double rate) {
        use({.full_search_every = full_search_every, .confirm = false});
        camera = Camera(pinhole, 7);
        for (int frame = 0; frame < 4; ++frame) {
            arhost_observation seen = see(pose_at({frame < 3 ? 0.0 : 150.0, 0, 2500}, 20), 5, single, 0.1);
            seen.false_positive_rate = rate;
            solve({seen}, frame);
        }
        return before;
    };
    const auto certain = branches_after_a_jump(0), doubtful = branches_after_a_jump(small_family);
    EXPECT_EQ(certain, doubtful);
}

TEST_F(TargetSolverTest, NeedsMoreSightingsTheMoreLikelyChanceIs) {
    const auto frames_needed = [&](double rate) {
        arhost_observation seen = see(pose_at({20, 10, 900}, 30), 5);
        seen.false_positive_rate = rate;
        solved = {};
        is_first = true;
        int frames = 0;
        for (; frames < 20 && solved[cup].state != ARHOST_TARGET_DETECTED; ++frames)
            solve({seen}, frames);
        return frames;
    };
    EXPECT_EQ(frames_needed(0), 1) << "unknown";
    EXPECT_EQ(frames_needed(1e-8), 1) << "five markers of the family are listed";
    EXPECT_EQ(frames_needed(3e-8), 2);
    EXPECT_EQ(frames_needed(8e-3), 4);
    EXPECT_EQ(frames_needed(1), 20) << "never";
}

TEST_F(TargetSolverTest, ReportsSeveralMarkersThatAgreeAtOnce) {
    const Rigid truth = pose_at({20, 10, 900}, 30);
    const arhost_observation first = doubtful(truth, 10, on_board(10));
    solve({first, doubtful(truth, 11, on_board(11))});
    EXPECT_EQ(solved[board].state, ARHOST_TARGET_DETECTED);
    is_first = true;
    solve({first});
    EXPECT_EQ(solved[board].state, 0);
    is_first = true;
    solve({first, doubtful(pose_at({-300, 150, 900}, -10), 11, on_board(11))});
    EXPECT_EQ(solved[board].state, 0) << "they do not agree";
}

TEST_F(TargetSolverTest, AFalseMarkerDoesNotHideTheTrueOneOfAMap) {
    const Rigid truth = pose_at({20, 10, 900}, 30);
    const arhost_observation left = doubtful(truth, 12, on_board(12)), right = doubtful(truth, 13, on_board(13));
    solve({left, right});
    solve({left, right, doubtful(pose_at({-300, 150, 900}, -10), 10, on_board(10))}, 1);
    EXPECT_EQ(solved[board].state, ARHOST_TARGET_DETECTED);
    expect_near(pose_of(board), truth);
}

TEST_F(TargetSolverTest, ReportsEachMarkerAtOnceOnRequest) {
    use({.full_search_every = full_search_every, .confirm = false});
    solve({doubtful(pose_at({20, 10, 900}, 30))});
    EXPECT_EQ(solved[cup].state, ARHOST_TARGET_DETECTED);
}

TEST_F(TargetSolverTest, ExpectsNoMarkerThatIsOutOfView) {
    solve({see(pose_at({560, 0, 800}, 0), 5)}); // at the right border of the frame
    solve({see(pose_at({640, 0, 900}, 0), 5)}, 1);
    solve({}, 2);
    EXPECT_EQ(expectation.markers.size(), 1u);
    const Rigid gone = pose_at({0, 0, 900}, 30);
    solve({see(gone, 5)}, 40);
    EXPECT_TRUE(expectation.markers.empty()) << "it was not seen for more than a second";
}

TEST_F(TargetSolverTest, RejectsAReportThatViolatesTheContract) {
    const arhost_observation good = see(pose_at({0, 0, 900}, 30), 5);
    const auto altered = [](auto one, auto alter) { return alter(one), std::vector{one}; };
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THAT(violation(altered(good, [](auto &o) { o.family = 2; })), HasSubstr("family index 2"));
    EXPECT_THAT(violation(altered(good, [](auto &o) { o.corners_px[2][1] = nan; })),
                HasSubstr("marker 5 with a corner that is not finite"));
    EXPECT_THAT(violation(altered(good, [](auto &o) { o.decision_margin = -1; })), HasSubstr("decision margin"));
    EXPECT_THAT(violation(altered(good, [](auto &o) { o.corner_sigma_px = nan; })), HasSubstr("corner noise"));
    for (const double rate : {-0.1, 1.1, nan})
        EXPECT_THAT(violation(altered(good, [&](auto &o) { o.false_positive_rate = rate; })),
                    HasSubstr("false positive rate"));
    EXPECT_THAT(violation(std::vector(ARHOST_MAX_OBSERVATIONS + 1, good)),
                HasSubstr("1025 observations; the limit is 1024"));
    EXPECT_THAT(violation({}, {body_pose(cup)}), HasSubstr("the target 0, which is not a body"));
    EXPECT_THAT(violation({}, {body_pose(4)}), HasSubstr("the target 4, which is not a body"));
    EXPECT_THAT(violation({}, {body_pose(head), body_pose(head)}), HasSubstr("two poses of the target 3"));
    EXPECT_THAT(violation({}, std::vector(5, body_pose(head))), HasSubstr("more poses than there are targets"));
    for (const auto alter : {+[](arhost_body_pose &p) { p.mt[0] = 2; }, +[](arhost_body_pose &p) { p.mt[12] = nan; },
                             +[](arhost_body_pose &p) { p.covariance[35] = nan; }})
        EXPECT_THAT(violation({}, altered(body_pose(head), alter)),
                    HasSubstr("not finite, or a pose that is no rotation"));
    EXPECT_THAT(violation({}, altered(body_pose(head), [](auto &p) { p.state = 0; })), HasSubstr("invalid state"));
    EXPECT_THAT(violation({}, altered(body_pose(head), [](auto &p) { p.age_frames = 5; })),
                HasSubstr("a detected body with an age of 5 frames"));
    EXPECT_EQ(violation({good}, {body_pose(head)}), "");
}

TEST_F(TargetSolverTest, SurvivesAStateOfArbitraryBytes) {
    std::mt19937 random(6);
    is_first = false;
    const std::size_t memory_size = solver->state_size() / targets.size();
    for (int round = 0; round < 400; ++round) {
        for (std::byte &byte : before)
            byte = static_cast<std::byte>(random());
        for (std::size_t at = 0; at < before.size() && round % 2; at += memory_size) { // begins with a valid track
            Track track;
            std::memcpy(&track, &before[at], sizeof track);
            track.capture_ns = 0;
            track.branches = 1 + static_cast<std::uint32_t>(round) / 2 % 2;
            if (round % 3 == 0)
                track.log_odds = std::nan("");
            std::memcpy(&before[at], &track, sizeof track);
        }
        arhost_observation seen = see(pose_at({0, 0, 1500}, 30), 5);
        if (round % 5 == 0)
            seen.false_positive_rate = 0.5;
        solve({seen}, 1);
        EXPECT_EQ(solved[cup].state == ARHOST_TARGET_DETECTED, round % 5 != 0) << "0.5 needs several sightings";
        EXPECT_TRUE(pose_of(cup).rotation.allFinite());
        EXPECT_EQ(solved[board].state, 0) << "its pose is none";
    }
}

} // namespace arhost::worker
