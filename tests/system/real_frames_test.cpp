// SPDX-License-Identifier: Apache-2.0
//
// Runs the real plugins on a recorded camera sequence of 40 frames of a tag36h11 board
// (shared/data/markers/rbt_sequence).
#include "arhost_run.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <map>

using namespace arhost::test;

namespace {

std::string configuration(const std::string &tracker, const std::string &more = "") {
    return "version: 1\nsource: {plugin: source_file, path: \"" + shared_data("markers/rbt_sequence").string() +
           "/color_image_%04d.png\", fps: 30}\n"
           "camera: {width: 640, height: 480, fx: 607.178466796875, fy: 607.2342529296875, cx: 321.39129638671875, "
           "cy: 241.91822814941406}\n"
           "tracker:\n  plugin: " +
           tracker +
           "\n  targets: [{ids: 0-19, family: tag36h11, side_mm: 95.5}]\n"
           "raytracer: {plugin: rt_embree, scene: " +
           arhost::test::source_directory() +
           "/config/scenes/optix-cs.yaml}\n"
           "outputs:\n- {plugin: sink_poses, path: poses.jsonl}\n- {plugin: sink_images, path: \"frames/%04d.png\"}\n"
           "stats: stats.json\n" +
           more;
}

const char *const aruco = "tracker_aruco", *const apriltag = "tracker_apriltag";

void expect_same_results(const ArhostRun &a, const ArhostRun &b) {
    EXPECT_EQ(a.read("poses.jsonl"), b.read("poses.jsonl"));
    for (int frame = 0; frame < 40; ++frame) {
        char name[32];
        std::snprintf(name, sizeof name, "frames/%04d.png", frame);
        ASSERT_TRUE(a.exists(name)) << name;
        ASSERT_EQ(a.read(name), b.read(name)) << name;
    }
}

} // namespace

TEST(RealFrames, BothTrackersAugmentEveryFrame) {
    ARHOST_REQUIRE_SHARED_DATA("markers/rbt_sequence");
    for (const char *tracker : {aruco, apriltag}) {
        ArhostRun run(configuration(tracker));
        ASSERT_EQ(run.run(), 0) << run.output();
        EXPECT_EQ(run.stats()["frames"]["augmented"], 40);
        std::istringstream lines(run.read("poses.jsonl"));
        std::uint64_t frame = 0;
        for (std::string line; std::getline(lines, line); ++frame) {
            const auto record = nlohmann::json::parse(line);
            EXPECT_EQ(record["frame"], frame);
            EXPECT_EQ(record["clock"], "media");
            ASSERT_GE(record["targets"].size(), 1u);
            EXPECT_EQ(record["targets"][0]["name"].get<std::string>().substr(0, 9), "tag36h11-");
            EXPECT_EQ(record["camera"]["eye"].size(), 3u);
        }
        EXPECT_EQ(frame, 40u);
    }
}

TEST(RealFrames, RunsAreReproducible) {
    ARHOST_REQUIRE_SHARED_DATA("markers/rbt_sequence");
    ArhostRun first(configuration(apriltag)), second(configuration(apriltag));
    ASSERT_EQ(first.run(), 0) << first.output();
    ASSERT_EQ(second.run(), 0) << second.output();
    expect_same_results(first, second);
}

TEST(RealFrames, KillingEveryWorkerDoesNotChangeTheResult) {
    ARHOST_REQUIRE_SHARED_DATA("markers/rbt_sequence");
    ArhostRun clean(configuration(aruco)), killed(configuration(aruco));
    ASSERT_EQ(clean.run(), 0) << clean.output();
    killed.start();
    int frame = 3;
    for (const char *plugin : {"source_file", "tracker_aruco", "rt_embree", "sink_poses", "sink_images"}) {
        char name[32];
        std::snprintf(name, sizeof name, "frames/%04d.png", frame += 4);
        ASSERT_TRUE(killed.eventually([&] { return killed.exists(name); })) << killed.output();
        const pid_t worker = killed.worker(plugin);
        ASSERT_NE(worker, 0) << plugin << "\n" << killed.output();
        ::kill(worker, SIGKILL);
    }
    ASSERT_EQ(killed.wait(), 0) << killed.output();
    expect_same_results(clean, killed);
    for (const char *component : {"source", "tracker", "raytracer", "sink_poses", "sink_images"})
        EXPECT_EQ(killed.stats()["restarts"][component], 1) << component << "\n" << killed.output();
}

// The memory of the filter and of the search survives the tracker.
TEST(RealFrames, KillingTheTrackerDoesNotChangeFilteredPoses) {
    ARHOST_REQUIRE_SHARED_DATA("markers/rbt_sequence");
    for (const std::string tracker : {aruco, apriltag}) {
        const std::string filtered = configuration(tracker + "\n  filter: adaptive");
        ArhostRun clean(filtered), killed(filtered), plain(configuration(tracker));
        ASSERT_EQ(clean.run(), 0) << clean.output();
        killed.start();
        // The second kill comes later than the frames that are in the pipeline at the first one (8 slots before and 8
        // after the composition): a frame that two workers die with is given up.
        for (const char *frame : {"frames/0001.png", "frames/0020.png"}) {
            ASSERT_TRUE(killed.eventually([&] { return killed.exists(frame); })) << killed.output();
            const pid_t worker = killed.worker(tracker);
            ASSERT_NE(worker, 0) << killed.output();
            ::kill(worker, SIGKILL);
        }
        ASSERT_EQ(killed.wait(), 0) << killed.output();
        expect_same_results(clean, killed);
        EXPECT_EQ(killed.stats()["restarts"]["tracker"], 2) << killed.output();
        ASSERT_EQ(plain.run(), 0) << plain.output();
        EXPECT_NE(clean.read("poses.jsonl"), plain.read("poses.jsonl")) << "the poses are not filtered";
    }
}
