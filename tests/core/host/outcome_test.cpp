// SPDX-License-Identifier: Apache-2.0
#include "host/outcome.hpp"

#include <gmock/gmock.h>

using namespace arhost;
using namespace arhost::host;
using testing::HasSubstr;

namespace {

struct Outcome : testing::Test {
    Outcome() {
        const yaml::Node node = yaml::Node::parse("{}", "run.yaml");
        configuration.emplace(run_config::Configuration{.node = node});
        configuration->tracker = run_config::TrackerConfiguration{
            {node, {}, {}, {}, {}, {}, false}, {{"desk", {{23, "D", {}}}, ""}, {"cup", {{7, "D", {}}}, ""}}};
        configuration->raytracer =
            run_config::RaytracerConfiguration{{node, {}, {}, {}, {}, {}, false}, "scene.yaml", node};
        statistics.frames_in = statistics.composited = statistics.tracker_results = 30;
        statistics.augmented = 20;
    }
    std::optional<Problem> problem() const {
        return problem_with_run(*configuration, statistics, configuration->tracker->targets);
    }
    std::optional<run_config::Configuration> configuration;
    Statistics statistics;
};

} // namespace

TEST_F(Outcome, IsGoodIfSomeFramesHaveAnOverlay) {
    statistics.targets["desk"].frames = 20;
    EXPECT_FALSE(problem());
    statistics.augmented = 1;
    EXPECT_FALSE(problem());
    configuration->mode = run_config::Mode::live;
    EXPECT_FALSE(problem());
}

TEST_F(Outcome, ReportsATargetThatWasNeverSeen) {
    statistics.augmented = 0;
    for (const auto mode : {run_config::Mode::lockstep, run_config::Mode::live}) {
        configuration->mode = mode;
        ASSERT_TRUE(problem());
        EXPECT_TRUE(problem()->is_missing_target);
        EXPECT_EQ(problem()->component, "tracker");
        EXPECT_THAT(problem()->text, HasSubstr("no target was seen in 30 frames"));
        EXPECT_THAT(problem()->text, HasSubstr("it looked for 'desk' (D 23), 'cup' (D 7);"));
    }
    EXPECT_THAT(problem()->text, HasSubstr("30 frames, so no frame has an overlay; it looked"));
    configuration->raytracer.reset();
    EXPECT_THAT(problem()->text, HasSubstr("30 frames; it looked"));
    statistics.frames_in = 0;
    EXPECT_FALSE(problem()) << "there was no frame in which to see it";
    statistics.frames_in = 30;
    configuration->mode = run_config::Mode::lockstep;
    configuration->trajectory.emplace();
    EXPECT_FALSE(problem()) << "the poses do not come from the tracker";
}

TEST_F(Outcome, ReportsATrackerThatFailsInEveryFrame) {
    statistics.augmented = statistics.tracker_results = 0;
    statistics.skipped["tracker"] = 30;
    ASSERT_TRUE(problem());
    EXPECT_FALSE(problem()->is_missing_target);
    EXPECT_THAT(problem()->text, HasSubstr("failed in every frame"));
    statistics.tracker_results = statistics.targets["desk"].frames = statistics.augmented = 1;
    EXPECT_FALSE(problem());
}

TEST_F(Outcome, ReportsThatTheFirstTargetWasNeverSeen) {
    statistics.augmented = 0;
    statistics.targets["cup"].frames = 20;
    statistics.unlisted = {{"D 24", 29}};
    for (const auto mode : {run_config::Mode::lockstep, run_config::Mode::live}) {
        configuration->mode = mode;
        ASSERT_TRUE(problem());
        EXPECT_TRUE(problem()->is_missing_target);
        EXPECT_EQ(problem()->text,
                  "no frame has an overlay, because 'desk', the first target, is the world of the scene; never seen "
                  "in 30 frames: 'desk' (D 23); it saw D 24 (29 frames); compare the numbers and the family with the "
                  "print");
    }
    configuration->raytracer.reset();
    EXPECT_FALSE(problem()) << "no overlay was requested";
}

TEST_F(Outcome, NamesTargetsThatDoNotFit) {
    std::vector<model::Target> targets{{"board", {{0, "D", {}}, {1, "D", {}}}, ""}, {"cup", {{7, "D", {}}}, ""}};
    EXPECT_EQ(misfitting_targets(statistics, targets), "");
    statistics.targets["cup"].mean_reprojection_px = 18.9;
    EXPECT_EQ(misfitting_targets(statistics, targets),
              "the corners and the computed poses disagree: 'cup' (mean reprojection error 18.9 px); check the "
              "calibration of the camera and the proportions of the prints");
    statistics.targets["board"].mean_reprojection_px = 47.14;
    EXPECT_THAT(misfitting_targets(statistics, targets),
                testing::AllOf(HasSubstr("'board' (mean reprojection error 47.1 px), 'cup' ("),
                               testing::EndsWith("prints, and the places and sides in the map ('arhost map' learns a "
                                                 "map)")));
    statistics.targets["board"].mean_reprojection_px = 2.9;
    statistics.targets["cup"].largest_px = 1900;
    EXPECT_EQ(misfitting_targets(statistics, targets), "");
}

TEST_F(Outcome, SaysThatNoTargetIsVisibleAndWhatIsInstead) {
    using std::chrono::seconds;
    const std::chrono::steady_clock::time_point start{};
    const auto missing = [&](seconds after) {
        return missing_target(*configuration, statistics, configuration->tracker->targets, start + after);
    };
    EXPECT_EQ(missing(seconds(60)), "") << "a target is visible";
    statistics.without_target_since = start;
    statistics.unlisted = {{"D 24", 29}};
    EXPECT_EQ(missing(seconds(0)), "");
    EXPECT_EQ(missing(seconds(3)),
              "the tracker has seen no target yet; it looks for 'desk' (D 23), 'cup' (D 7); it saw D 24 (29 frames); "
              "compare the numbers and the family with the print");
    statistics.targets["cup"].frames = 20;
    EXPECT_THAT(missing(seconds(3)), testing::StartsWith("the tracker has seen no target for 3 s; it looks for "));
    configuration->trajectory.emplace();
    EXPECT_EQ(missing(seconds(3)), "") << "the poses do not come from the tracker";
}

TEST_F(Outcome, ReportsThatEveryOverlayWasLateInModeLive) {
    statistics.augmented = 0;
    statistics.targets["desk"].frames = 20;
    statistics.skipped["latency"] = 27;
    EXPECT_FALSE(problem()) << "mode lockstep waits";
    configuration->mode = run_config::Mode::live;
    ASSERT_TRUE(problem());
    EXPECT_EQ(problem()->component, "raytracer");
    EXPECT_THAT(problem()->text, HasSubstr("30 frames shown, none with an overlay (27 frames: latency); raise "
                                           "'live.max_latency_ms'"));
    configuration->raytracer.reset();
    EXPECT_FALSE(problem()) << "no overlay was requested";
}

TEST_F(Outcome, NamesTheMarkersThatWereSeenInsteadOfATarget) {
    statistics.augmented = 0;
    statistics.unlisted = {{"D 5", 1}, {"D 24", 29}};
    ASSERT_TRUE(problem());
    EXPECT_THAT(problem()->text, HasSubstr("'cup' (D 7); it saw D 24 (29 frames), D 5 (1 frame); compare"));
}

TEST_F(Outcome, NamesTargetsThatWereNeverSeenAlthoughOthersWere) {
    EXPECT_EQ(unseen_targets(*configuration, statistics, configuration->tracker->targets), "")
        << "problem_with_run reports that none was seen";
    statistics.targets["desk"].frames = 20;
    EXPECT_EQ(unseen_targets(*configuration, statistics, configuration->tracker->targets),
              "never seen in 30 frames: 'cup' (D 7)");
    statistics.unlisted = {{"D 8", 30}};
    EXPECT_EQ(unseen_targets(*configuration, statistics, configuration->tracker->targets),
              "never seen in 30 frames: 'cup' (D 7); it saw D 8 (30 frames)");
    statistics.unconfirmed = {{"D 7", 2}};
    EXPECT_EQ(
        unseen_targets(*configuration, statistics, configuration->tracker->targets),
        "never seen in 30 frames: 'cup' (D 7); it saw D 8 (30 frames); it saw D 7 (2 frames) but got no pose: "
        "either the corners fit none (check the calibration of the camera, and whether something hides a "
        "corner), or a small family was not seen in successive frames (see 'tracker.confirm' in docs/config.md)");
    statistics.unconfirmed = {{"D 23", 2}};
    EXPECT_THAT(unseen_targets(*configuration, statistics, configuration->tracker->targets), Not(HasSubstr("D 23")))
        << "its target was seen";
    statistics.targets["cup"].frames = 1;
    EXPECT_EQ(unseen_targets(*configuration, statistics, configuration->tracker->targets), "");
}

TEST_F(Outcome, TellsWhetherThereWereQuadrilateralsIfNothingWasSeen) {
    const std::vector<model::Target> &targets = configuration->tracker->targets;
    EXPECT_EQ(seen_instead(statistics, targets), "") << "the tracker does not count them";
    statistics.search.frames_with_candidate_count = 30;
    EXPECT_THAT(seen_instead(statistics, targets), testing::StartsWith("; it found no quadrilaterals"));
    statistics.search.candidates = 75;
    EXPECT_EQ(seen_instead(statistics, targets),
              "; of 2.5 quadrilaterals per frame, none could be read as a marker of these targets");
    statistics.hints = {"frame 30 has other markers: D 9", "frame 60 has other markers: E 1"};
    EXPECT_EQ(seen_instead(statistics, targets),
              "; frame 30 has other markers: D 9; frame 60 has other markers: E 1");
    statistics.hints.clear();
    statistics.unlisted = {{"D 8", 30}};
    EXPECT_EQ(seen_instead(statistics, targets), "; it saw D 8 (30 frames)");
}

TEST_F(Outcome, TellsWhatToCompare) {
    const model::Target marker{"cup", {{7, "D", {}}}, ""},
        pattern{"card", {{3, "pattern", {}, "/lab/hiro.patt"}}, ""}, body{"head", {}, "skull"};
    EXPECT_EQ(how_to_compare({marker, pattern, body}),
              "; compare the numbers and the family with the print; compare the files with the prints");
    EXPECT_EQ(how_to_compare({pattern}), "; compare the files with the prints");
    EXPECT_EQ(how_to_compare({body}), "");
}

TEST_F(Outcome, NamesAPatternByItsFile) {
    model::TargetMarker marker{3, "pattern", {}, "/lab/hiro.patt"};
    statistics.unconfirmed = {{"pattern hiro.patt", 2}};
    EXPECT_THAT(seen_instead(statistics, {{"card", {marker}, ""}}),
                testing::StartsWith("; it saw pattern hiro.patt (2 frames) but got no pose, because the corners fit "
                                    "none: check the calibration of the camera, the proportions of the print"));
}

TEST(Targets, AreDescribedByTheirMarkers) {
    const model::Target cup{"cup", {{7, "D", {}}}, ""}, head{"head", {}, "skull"};
    model::Target board{"board", {}, ""};
    for (int id = 0; id < 12; ++id)
        board.markers.push_back({id, "tag36h11", {}});
    EXPECT_EQ(describe_targets({cup, board, head}),
              "'cup' (D 7), 'board' (map of 12 markers of tag36h11), 'head' (body 'skull')");
    EXPECT_EQ(describe_targets({{"hiro", {{0, "pattern", {}, "/prints/hiro.patt", 0.5}}, ""}}),
              "'hiro' (pattern hiro.patt)");
    EXPECT_EQ(describe_targets(std::vector<model::Target>(10, head)).substr(8 * 23 - 2), " and 2 more");
}
