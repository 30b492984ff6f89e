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
        configuration->tracker = run_config::TrackerConfiguration{{node, {}, {}, {}, {}, {}, false}, {}, 0};
        configuration->raytracer =
            run_config::RaytracerConfiguration{{node, {}, {}, {}, {}, {}, false}, "scene.yaml", node};
        statistics.frames_in = statistics.composited = statistics.tracker_results = 30;
        statistics.tracked = statistics.augmented = 20;
    }
    std::optional<Problem> problem() const {
        return problem_with_run(*configuration, statistics, "marker 23 (dictionary D)");
    }
    std::optional<run_config::Configuration> configuration;
    Statistics statistics;
};

} // namespace

TEST_F(Outcome, IsGoodIfSomeFramesHaveAnOverlay) {
    EXPECT_FALSE(problem());
    statistics.tracked = statistics.augmented = 1;
    EXPECT_FALSE(problem());
    configuration->mode = run_config::Mode::live;
    EXPECT_FALSE(problem());
}

TEST_F(Outcome, ReportsATargetThatWasNeverSeen) {
    statistics.tracked = statistics.augmented = 0;
    for (const auto mode : {run_config::Mode::lockstep, run_config::Mode::live}) {
        configuration->mode = mode;
        ASSERT_TRUE(problem());
        EXPECT_TRUE(problem()->is_missing_target);
        EXPECT_EQ(problem()->component, "tracker");
        EXPECT_THAT(problem()->text, HasSubstr("no marker was seen in any of 30 frames"));
        EXPECT_THAT(problem()->text, HasSubstr("it looked for marker 23 (dictionary D);"));
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
    statistics.tracked = statistics.augmented = statistics.tracker_results = 0;
    statistics.skipped["tracker"] = 30;
    ASSERT_TRUE(problem());
    EXPECT_FALSE(problem()->is_missing_target);
    EXPECT_THAT(problem()->text, HasSubstr("failed in every frame"));
    statistics.tracker_results = statistics.tracked = 1;
    EXPECT_FALSE(problem());
}

TEST_F(Outcome, ReportsThatEveryOverlayWasLateInModeLive) {
    statistics.augmented = 0;
    statistics.skipped["latency"] = 27;
    EXPECT_FALSE(problem()) << "mode lockstep waits";
    configuration->mode = run_config::Mode::live;
    ASSERT_TRUE(problem());
    EXPECT_EQ(problem()->component, "raytracer");
    EXPECT_THAT(problem()->text, HasSubstr("none of the 30 frames shown has an overlay (27 frames: latency); raise "
                                           "'live.max_latency_ms'"));
    configuration->raytracer.reset();
    EXPECT_FALSE(problem()) << "no overlay was requested";
}

TEST(Targets, AreDescribedByNumbersAndDictionary) {
    ipc::PluginDescription plugin;
    plugin.options = {{"dictionary", ARHOST_OPTION_TEXT, "D", 0, 0, {"D", "E"}, ""},
                      {"threads", ARHOST_OPTION_INTEGER, "2", 1, 8, {}, ""}};
    const std::vector<ipc::OptionValue> options = {{"dictionary", ARHOST_OPTION_TEXT, 0, 0, "E"},
                                                   {"threads", ARHOST_OPTION_INTEGER, 2, 0, ""}};
    EXPECT_EQ(describe_targets({{sizeof(arhost_marker_config), 23, 80}}, plugin, options),
              "marker 23 (dictionary E)");
    EXPECT_EQ(
        describe_targets({{sizeof(arhost_marker_config), 2, 80}, {sizeof(arhost_marker_config), 7, 80}}, {}, {}),
        "the markers 2, 7");
}
