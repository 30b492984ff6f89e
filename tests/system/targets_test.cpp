// SPDX-License-Identifier: Apache-2.0
//
// Targets of all kinds in whole runs.
#include "arhost_run.hpp"

#include <gmock/gmock.h>

#include <cmath>

using namespace arhost::test;
using testing::HasSubstr;
using Json = nlohmann::json;

namespace {

std::string configuration(const std::string &tracker, const std::string &targets, const std::string &options = "",
                          int frames = 20) {
    return "version: 1\nsource: {plugin: source_counter, options: {frames: " + std::to_string(frames) +
           "}}\ntracker: {plugin: " + tracker + ", targets: " + targets + ", options: {" + options +
           "}}\noutputs: [{plugin: sink_poses, path: poses.jsonl}]\nstats: stats.json\n";
}

std::vector<Json> records_of(const ArhostRun &run) {
    std::istringstream lines(run.read("poses.jsonl"));
    std::vector<Json> records;
    for (std::string line; std::getline(lines, line);)
        records.push_back(Json::parse(line));
    return records;
}

} // namespace

TEST(Targets, ATrackerReportsThePosesOfBodies) {
    ArhostRun run(configuration("tracker_body", "[{name: visor, body: head}, {name: glove, body: hand}]",
                                "lost_from: 8, lost_to: 12"));
    ASSERT_EQ(run.run(), 0) << run.output();
    const std::vector<Json> records = records_of(run);
    ASSERT_EQ(records.size(), 20u);
    for (std::size_t frame = 0; frame < records.size(); ++frame) {
        const Json &targets = records[frame]["targets"];
        ASSERT_EQ(targets.size(), 2u);
        const bool is_lost = frame >= 8 && frame < 12;
        const double shown = is_lost ? 7 : static_cast<double>(frame);
        EXPECT_EQ(targets[0]["name"], "visor");
        EXPECT_EQ(targets[1]["name"], "glove");
        EXPECT_EQ(targets[1]["state"], is_lost ? "lost" : "detected") << frame;
        EXPECT_EQ(targets[1]["age_frames"], is_lost ? frame - 7 : 0) << frame;
        EXPECT_EQ(targets[1]["mt"][12], shown);
        EXPECT_EQ(targets[1]["mt"][13], 20);
        EXPECT_EQ(targets[1]["mt"][0], std::cos(shown / 100));
        if (!is_lost) {
            EXPECT_EQ(targets[1]["covariance"][0], 0.25);
            EXPECT_TRUE(targets[1]["observations"].empty());
        }
    }
    EXPECT_EQ(run.stats()["targets"]["visor"]["frames"], 16);
}

TEST(Targets, ADetectorCannotFollowABody) {
    ArhostRun run(configuration("tracker_counter", "[{name: visor, body: head}]"));
    run.expect(2, {"run.yaml:3:",
                   "tracker.targets: the target 'visor' is a body, but 'tracker_counter' finds only markers"});
}

TEST(Targets, ABodyThatTheTrackerDoesNotKnowIsAnErrorOfTheConfiguration) {
    ArhostRun run(configuration("tracker_body", "[{name: visor, body: foot}]"));
    run.expect(2, {"there is no body 'foot'; known: head hand"});
}

TEST(Targets, MayBeAsManyAsTheLimit) {
    ArhostRun run(configuration("tracker_counter",
                                "[{ids: 0-999, family: DICT_6X6_1000, side_mm: 80}, {ids: 0-23, family: tag36h11, "
                                "side_mm: 40}]",
                                "all: true", 3));
    ASSERT_EQ(run.run(), 0) << run.output();
    const std::vector<Json> records = records_of(run);
    ASSERT_EQ(records.size(), 3u);
    for (std::size_t frame = 0; frame < records.size(); ++frame) {
        ASSERT_EQ(records[frame]["targets"].size(), 1024u);
        const Json &last = records[frame]["targets"][1023];
        EXPECT_EQ(last["name"], "tag36h11-23");
        EXPECT_NEAR(last["mt"][14].get<double>(), -500.0 - static_cast<double>(frame), 1e-6);
        EXPECT_EQ(last["observations"].size(), 1u);
        EXPECT_EQ(last["observations"][0]["id"], 23);
    }
    EXPECT_EQ(run.stats()["targets"].size(), 1024u);
}

TEST(Targets, AMapIsOneTarget) {
    ArhostRun run(configuration("tracker_counter", "[{name: board, map: board.yaml}]", "all: true", 3));
    run.write("board.yaml", "version: 1\nfamily: tag36h11\nmarkers:\n"
                            "- {id: 4, side_mm: 30, position_mm: [-40, 0, 0]}\n"
                            "- {id: 9, side_mm: 30, position_mm: [40, 10, 20], rotation_degrees: [0, 35, 10]}\n");
    ASSERT_EQ(run.run(), 0) << run.output();
    for (const Json &record : records_of(run)) {
        ASSERT_EQ(record["targets"].size(), 1u);
        const Json &board = record["targets"][0];
        EXPECT_EQ(board["name"], "board");
        EXPECT_EQ(board["observations"].size(), 2u);
        EXPECT_NEAR(board["mt"][14].get<double>(), -500.0 - record["frame"].get<double>(), 1e-6);
        EXPECT_LT(board["reprojection_px"].get<double>(), 1e-6);
    }
}

TEST(Targets, ATrackerIsSwappedInOneLine) {
    for (const std::string tracker : {"tracker_aruco", "tracker_apriltag"}) {
        ArhostRun run(
            "version: 1\nsource: {plugin: source_synthetic, options: {frames: 3, family: tag36h11, id: 4}}\n"
            "tracker:\n  plugin: " +
            tracker +
            "\n  targets: [{marker: 4, family: tag36h11, side_mm: 80}]\n"
            "  options: {quad_decimate: 1, min_perimeter_rate: 0.02, corner_refinement: subpix}\n"
            "outputs: [{plugin: sink_null}]\n");
        run.expect(0,
                   {tracker == "tracker_aruco" ? "options.quad_decimate: set aside, because tracker_aruco has no"
                                               : "options.min_perimeter_rate: set aside, because tracker_apriltag"});
        EXPECT_EQ(run.output().find("options.corner_refinement: 'subpix' is set aside, because tracker_apriltag has "
                                    "no such choice") != std::string::npos,
                  tracker == "tracker_apriltag");
    }
}

TEST(Targets, MarkersOfNoTargetAreNamedIfTargetsAreMissing) {
    const std::string yaml =
        "version: 1\nsource: {plugin: source_synthetic, options: {frames: 10, family: tag36h11, id: 4}}\n"
        "tracker: {plugin: tracker_aruco, targets: [{marker: 5, family: tag36h11, side_mm: 80}]}\n"
        "outputs: [{plugin: sink_null}]\nstats: stats.json\n";
    ArhostRun run(yaml);
    run.expect(1, {"it looked for 'tag36h11-5' (tag36h11 5); it saw tag36h11 4 (10 frames)"});
    EXPECT_EQ(run.stats()["unlisted_markers"]["tag36h11 4"], 10);
}

TEST(Targets, MarkersOfOtherDictionariesAreNamedIfTargetsAreMissing) {
    ArhostRun run(
        "version: 1\nsource: {plugin: source_synthetic, options: {frames: 3, family: DICT_5X5_250, id: 104}}\n"
        "tracker: {plugin: tracker_aruco, targets: [{marker: 5, family: tag36h11, side_mm: 80}]}\n"
        "outputs: [{plugin: sink_null}]\n");
    run.expect(1, {"it looked for 'tag36h11-5' (tag36h11 5); other markers were in view: "
                   "DICT_5X5_250 104; compare the numbers and the family with the print"});
    EXPECT_THAT(run.output(), Not(HasSubstr("info: tracker: other"))) << "told twice";
}
