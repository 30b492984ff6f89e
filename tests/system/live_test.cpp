// SPDX-License-Identifier: Apache-2.0
//
// Mode live: the newest frame wins, and the video never waits for a backend.
#include "arhost_run.hpp"

#include <gmock/gmock.h>

using namespace arhost::test;
using testing::HasSubstr;

namespace {

// Ascending, each overlay from its own frame's pose.
void expect_own_overlays_in_order(const std::vector<CountedLine> &lines) {
    for (std::size_t i = 0; i < lines.size(); ++i) {
        ASSERT_EQ(lines[i].video, lines[i].sequence);
        if (i > 0) {
            ASSERT_GT(lines[i].sequence, lines[i - 1].sequence);
        }
        if (lines[i].overlay != "none") {
            ASSERT_EQ(lines[i].overlay, std::to_string(lines[i].sequence)) << "the overlay is another frame's";
        }
    }
}

std::uint64_t dropped(const nlohmann::json &stats) { // at all stages together
    std::uint64_t sum = 0;
    for (const auto &[stage, count] : stats["frames"]["dropped"].items())
        sum += count.get<std::uint64_t>();
    return sum;
}

} // namespace

TEST(Live, ASlowRayTracerGetsTheNewestFrameAndDropsAreCountedThere) {
    ArhostRun run(counting("live", "frames: 60", "", "delay_ms: 300", "live: {max_latency_ms: 60000}\n"));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run(), 0) << run.output();
    const auto lines = counted(run);
    expect_own_overlays_in_order(lines);
    const auto stats = run.stats();
    EXPECT_EQ(stats["frames"]["in"], 60);
    // 300 ms a frame at 30 fps: eight of nine frames are dropped, however fast the machine is.
    EXPECT_GE(stats["frames"]["dropped"]["raytracer"], 25);
    EXPECT_EQ(dropped(stats) + lines.size(), 60u) << "each frame is shown or counted where it was dropped\n"
                                                  << stats.dump(1);
    for (const auto &line : lines)
        EXPECT_NE(line.overlay, "none") << "a slow ray tracer must not make the overlay flicker";
}

// The real plugins at 30 frames a second; at 64 samples a pixel no machine's ray tracer keeps up.
TEST(Live, EachShownFrameIsTheOneThatLockstepMakesOfIt) {
#if defined(__SANITIZE_ADDRESS__)
    GTEST_SKIP() << "takes minutes under a sanitizer";
#endif
    const std::string yaml =
        "version: 1\nsource: {plugin: source_synthetic, fps: 30, options: {frames: 45, width: 320, height: 180}}\n"
        "tracker: {plugin: tracker_aruco, options: {dictionary: DICT_APRILTAG_36h11}, markers: [{id: 0, side_mm: "
        "80}]}\n"
        "raytracer: {plugin: rt_embree, scene: " ARHOST_SOURCE_DIRECTORY
        "/config/scenes/demo.yaml, options: {samples: 64}, deadline_ms: 60000}\n"
        "outputs: [{plugin: sink_images, path: \"%04d.png\"}]\nlive: {max_latency_ms: 60000}\nstats: stats.json\n";
    ArhostRun live(yaml), lockstep(yaml);
    ASSERT_EQ(live.run({"--config", "run.yaml", "--set", "mode=live"}), 0) << live.output();
    const auto stats = live.stats();
    std::uint64_t shown = 0;
    EXPECT_GT(stats["frames"]["dropped"]["raytracer"], 0) << stats.dump(1);
    ASSERT_EQ(lockstep.run({"--config", "run.yaml", "--set", "source.fps=0"}), 0) << lockstep.output();
    for (int frame = 0; frame < 45; ++frame) {
        char name[16];
        std::snprintf(name, sizeof name, "%04d.png", frame);
        if (!live.exists(name))
            continue;
        ++shown;
        EXPECT_TRUE(live.read(name) == lockstep.read(name)) << name << ": the overlay is another frame's";
    }
    EXPECT_EQ(shown + dropped(stats), 45u) << stats.dump(1);
    EXPECT_GT(shown, 2u);
}

TEST(Live, TheVideoGoesOnWhileABackendHangs) {
    ArhostRun run(counting("live", "frames: 120", "", "hang_at: 20", "live: {max_latency_ms: 150}\n"));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run({"--config", "run.yaml", "--set", "raytracer.deadline_ms=700"}), 0) << run.output();
    const auto lines = counted(run);
    expect_own_overlays_in_order(lines);
    const auto plain =
        std::count_if(lines.begin(), lines.end(), [](const auto &line) { return line.overlay == "none"; });
    EXPECT_GE(plain, 5) << "the plain video was to go on until the deadline";
    ASSERT_GT(lines.size(), 20u);
    EXPECT_TRUE(std::any_of(lines.end() - 20, lines.end(), [](const auto &line) { return line.overlay != "none"; }))
        << "the overlay was to come back";
    EXPECT_GE(run.stats()["restarts"]["raytracer"], 1);
}

TEST(Live, TheVideoGoesOnWhileABackendIsDown) {
    ArhostRun run(
        counting("live", "frames: 90", "", "",
                 "live: {max_latency_ms: 60000}\nrestart: {proven_after_frames: 100000, first_delay_ms: 600}\n"));
    run.write("scene.yaml", small_scene);
    run.start();
    while (run.running() && counted(run).size() < 15)
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    ::kill(run.worker("tracker_counter"), SIGKILL);
    ASSERT_EQ(run.wait(), 0) << run.output();
    const auto lines = counted(run);
    expect_own_overlays_in_order(lines);
    EXPECT_GE(std::count_if(lines.begin(), lines.end(), [](const auto &line) { return line.overlay == "none"; }), 8);
    EXPECT_NE(lines.back().overlay, "none");
}

TEST(Live, ASlowOutputDropsItsOwnFramesOnly) {
    ArhostRun run("version: 1\nmode: live\nsource: {plugin: source_counter, options: {frames: 60}}\n"
                  "outputs:\n- {plugin: sink_counter, path: counted.txt}\n- {plugin: sink_counter, path: slow.txt, "
                  "options: {delay_ms: 120}}\n"
                  "stats: stats.json\n");
    ASSERT_EQ(run.run(), 0) << run.output();
    const auto stats = run.stats();
    EXPECT_GE(stats["frames"]["dropped"]["sink_counter#1"], 20);
    EXPECT_GE(counted(run).size(), 40u);
}

TEST(Live, ASourceThatHasLeftFramesOutGoesOnBehindThemAfterADeath) {
    ArhostRun run(
        "version: 1\nmode: live\nsource: {plugin: source_synthetic, fps: 50, options: {frames: 250}, conform: "
        "true}\ncamera: {width: 64, height: 48, fx: 60}\noutputs: [{plugin: sink_counter, path: "
        "counted.txt}]\nstats: stats.json\n");
    run.start();
    const auto wait_for_frames = [&](std::size_t more) {
        for (const std::size_t frames = counted(run).size() + more; run.running() && counted(run).size() < frames;)
            std::this_thread::sleep_for(std::chrono::milliseconds(2));
    };
    wait_for_frames(10);
    const pid_t source = run.worker("source_synthetic");
    ::kill(source, SIGSTOP);
    std::this_thread::sleep_for(std::chrono::milliseconds(400)); // 20 frames
    ::kill(source, SIGCONT);
    wait_for_frames(5);
    ::kill(source, SIGKILL);
    ASSERT_EQ(run.wait(), 0) << run.output();
    const auto stats = run.stats();
    EXPECT_EQ(stats["restarts"]["source"], 1) << run.output();
    EXPECT_GE(stats["frames"]["dropped"]["source"], 15);
    // A death comes between no two frames: each is given, or told as skipped. Those at the very end, maybe not.
    EXPECT_LE(stats["frames"]["in"].get<int>() + stats["frames"]["dropped"]["source"].get<int>(), 250);
    for (const auto &[promise, entry] : stats["conformance"].items())
        EXPECT_EQ(entry["broken"], 0) << promise;
}
