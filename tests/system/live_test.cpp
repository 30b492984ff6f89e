// SPDX-License-Identifier: Apache-2.0
//
// Tests of mode live: stages process the newest frame, and the video never waits for a tracker or ray tracer.
#include "arhost_run.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

using namespace arhost::test;
using testing::HasSubstr;

namespace {

std::uint64_t dropped(const nlohmann::json &stats) { // sum over all stages of the pipeline
    std::uint64_t sum = 0;
    for (const auto &[stage, count] : stats["frames"]["dropped"].items())
        sum += count.get<std::uint64_t>();
    return sum;
}

} // namespace

TEST(Live, ASlowRayTracerDropsFramesAndCountsThem) {
    CountingRun run({.mode = "live",
                     .source = "frames: 120",
                     .raytracer = "delay_ms: 300",
                     .more = "live: {max_latency_ms: 60000}\n"});
    ASSERT_EQ(run.run(), 0) << run.output();
    const auto lines = counted(run);
    expect_own_overlays(lines);
    const auto stats = run.stats();
    EXPECT_EQ(stats["frames"]["in"], 120);
    // At 30 fps and 300 ms per image, at least eight of nine frames are dropped on any machine.
    EXPECT_GE(stats["frames"]["dropped"]["raytracer"], 25);
    EXPECT_EQ(dropped(stats) + lines.size(), 120u) << "each frame is either shown or counted as dropped\n"
                                                   << stats.dump(1);
    for (const auto &line : lines)
        EXPECT_NE(line.overlay, "none") << "a slow ray tracer must not make the overlay flicker";
}

// The ray tracer draws how many images it has rendered before. Those that frames have overtaken do not count.
TEST(Live, AnImageThatIsLateLeavesTheStateAsItWas) {
    CountingRun run({.mode = "live",
                     .source = "frames: 150",
                     .raytracer = "state_size: 8, delay_ms: 1000, delay_from: 10, delay_until: 40",
                     .more = "live: {max_latency_ms: 300}\n"});
    ASSERT_EQ(run.run(), 0) << run.output();
    std::uint64_t images = 0, last = 0;
    for (const CountedLine &line : counted(run))
        if (line.overlay != "none") {
            EXPECT_EQ(line.overlay, std::to_string(images++)) << "frame " << line.sequence;
            last = line.sequence;
        }
    const auto stats = run.stats();
    EXPECT_GE(stats["frames"]["dropped"].value("late", 0), 1) << stats.dump(1);
    EXPECT_GE(last, 40u) << "no image follows the late one";
}

TEST(Live, CancelsAnUnneededImageAtTheEnd) {
    CountingRun run({.mode = "live",
                     .source = "frames: 40",
                     .raytracer = "delay_ms: 600000",
                     .more = "live: {max_latency_ms: 100}\n",
                     .deadline = std::chrono::minutes(10)});
    ASSERT_EQ(run.run(), 1) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("cancelled while waiting"));
    EXPECT_THAT(run.output(), testing::ContainsRegex("error: raytracer: [0-9]+ frames shown, none with an overlay "
                                                     "\\([0-9]+ frames: latency\\); raise 'live.max_latency_ms'"));
    EXPECT_EQ(run.stats()["frames"]["in"], 40);
    EXPECT_EQ(dropped(run.stats()) + counted(run).size(), 40u) << run.stats().dump(1);
    EXPECT_EQ(run.stats()["restarts"]["raytracer"], 0);
}

// Uses the real plugins at 30 fps. With 64 samples per pixel, the ray tracer cannot keep up on any machine. If the
// machine is busy, the tracker does not get every frame. tracker_aruco refines corners from where it expects them, so
// its poses differ slightly after a gap. tracker_apriltag detects the marker in the whole frame, independently of
// earlier frames.
TEST(Live, ShownFramesEqualThoseOfLockstep) {
#if defined(__SANITIZE_ADDRESS__)
    GTEST_SKIP() << "takes minutes under a sanitizer";
#endif
    const std::string yaml =
        "version: 1\nsource: {plugin: source_synthetic, fps: 30, options: {frames: 45, width: 320, height: 180}}\n"
        "tracker: {plugin: tracker_apriltag, full_search_every: 1, targets: [{marker: 0, family: tag36h11, side_mm: "
        "80}]}\n"
        "raytracer: {plugin: rt_embree, scene: " +
        arhost::test::source_directory() +
        "/tests/plugins/rt_embree/golden/desk.yaml, options: {samples: 64}, deadline_ms: 60000}\n"
        "outputs: [{plugin: sink_images, path: \"%04d.png\"}]\nlive: {max_latency_ms: 60000}\nstats: stats.json\n";
    ArhostRun live(yaml), lockstep(yaml);
    ASSERT_EQ(live.run({"--config", "run.yaml", "--set", "mode=live"}), 0) << live.output();
    const auto stats = live.stats();
    std::uint64_t shown = 0;
    EXPECT_GT(stats["frames"]["dropped"]["raytracer"], 0) << stats.dump(1);
    ASSERT_EQ(lockstep.run({"--config", "run.yaml", "--set", "source.fps=0"}), 0) << lockstep.output();
    const auto name_of = [](int frame) {
        char name[16];
        std::snprintf(name, sizeof name, "%04d.png", frame);
        return std::string(name);
    };
    // On a busy machine the source skips frames, and its later frames have lower numbers than in lockstep.
    const int skipped = stats["frames"]["dropped"].value("source", 0);
    for (int frame = 0; frame < 45; ++frame) {
        if (!live.exists(name_of(frame)))
            continue;
        ++shown;
        const std::string picture = live.read(name_of(frame));
        bool is_frame_of_lockstep = false;
        for (int i = frame; i <= std::min(frame + skipped, 44); ++i)
            is_frame_of_lockstep |= picture == lockstep.read(name_of(i));
        EXPECT_TRUE(is_frame_of_lockstep) << name_of(frame) << ": the overlay belongs to another frame\n"
                                          << stats.dump(1) << live.output();
    }
    EXPECT_EQ(shown + dropped(stats), 45u) << stats.dump(1);
    EXPECT_GT(shown, 2u);
}

TEST(Live, AStoppedOutputDropsOnlyItsOwnFrames) {
    ArhostRun run("version: 1\nmode: live\nsource: {plugin: source_counter, options: {frames: 100000}}\n"
                  "outputs:\n- {plugin: sink_counter, path: counted.txt}\n"
                  "- {plugin: sink_realtime, path: slow.txt, deadline_ms: 600000}\nstats: stats.json\n");
    run.start();
    ASSERT_TRUE(run.wait_for_lines(5, "slow.txt")) << run.output();
    const pid_t stopped = run.worker("sink_realtime");
    send_signal(stopped, SIGSTOP);
    EXPECT_TRUE(run.wait_for_lines(run.lines() + 60)) << run.output();
    send_signal(stopped, SIGCONT);
    send_signal(run.pid(), SIGINT);
    ASSERT_EQ(run.wait(), 130) << run.output();
    const auto frames = run.stats()["frames"];
    EXPECT_GE(frames["dropped"]["sink_realtime"], 40);
    EXPECT_EQ(frames["composited"], run.lines() + frames["dropped"].value("sink_counter", 0u)) << frames.dump(1);
}

// The source cannot deliver frames at this rate, so it skips many. The video lasts for 10 s.
TEST(Live, ARestartedSourceDoesNotRepeatSkippedFrames) {
    ArhostRun run("version: 1\nmode: live\nsource: {plugin: source_synthetic, fps: 10000, options: {frames: 100000}, "
                  "conform: true}\ncamera: {width: 64, height: 48, fx: 60}\n"
                  "outputs: [{plugin: sink_counter, path: counted.txt}]\nstats: stats.json\n");
    run.start();
    ASSERT_TRUE(run.wait_for_lines(20)) << run.output();
    send_signal(run.worker("source_synthetic"), SIGKILL);
    ASSERT_EQ(run.wait(), 0) << run.output();
    const auto stats = run.stats();
    EXPECT_EQ(stats["restarts"]["source"], 1) << run.output();
    EXPECT_GE(stats["frames"]["dropped"]["source"], 15);
    // Each frame is either delivered or reported as skipped; only the last frames may be missing.
    EXPECT_LE(stats["frames"]["in"].get<int>() + stats["frames"]["dropped"]["source"].get<int>(), 100000);
    for (const auto &[promise, entry] : stats["conformance"].items())
        EXPECT_EQ(entry["violations"], 0) << promise;
}

TEST(Live, LatencyCountsFromTheCapture) {
    // The frames arrive 200 ms after their capture.
    CountingRun run({.mode = "live", .source = "frames: 30, ahead_ms: -200"});
    ASSERT_EQ(run.run(), 0) << run.output();
    const auto stats = run.stats();
    EXPECT_EQ(stats["latency"]["from"], "capture");
    const auto composited = stats["stages"]["latency"], written = stats["latency"]["outputs"]["sink_counter"];
    EXPECT_EQ(composited["count"], stats["frames"]["composited"]);
    EXPECT_EQ(written["count"], stats["frames"]["composited"]);
    EXPECT_GE(composited["p50_ms"], 199) << stats.dump(1); // percentiles are accurate to 0.5 %
    for (const char *percentile : {"p50_ms", "p95_ms", "p99_ms", "max_ms"})
        EXPECT_GE(written[percentile], composited[percentile]) << percentile;
    EXPECT_THAT(run.output(), testing::ContainsRegex("fps, latency from capture, ms p50/p95/p99:  latency [0-9]"));
}

TEST(Live, LatencyCountsFromTheArrivalOfAFilm) {
    // Media times are shortly after 0: counted from them, the latency would be the age of this machine's clock.
    CountingRun run({.mode = "live", .source = "frames: 30"});
    ASSERT_EQ(run.run(), 0) << run.output();
    const auto stats = run.stats();
    EXPECT_EQ(stats["latency"]["from"], "arrival");
    EXPECT_LT(stats["stages"]["latency"]["max_ms"], 30'000) << stats.dump(1);
}

TEST(Latency, SaysHowToShowTheTimeCodes) {
    ArhostRun run(
        "version: 1\nsource: {plugin: source_synthetic, fps: 30, options: {width: 320, height: 240, frames: "
        "0, id: 300, side_mm: 80}}\noutputs: [{plugin: sink_null}]\nstats: stats.json\n");
    ASSERT_EQ(run.run({"latency", "run.yaml", "--frames", "180"}), 1) << run.output(); // 6 s
    EXPECT_THAT(run.output(), HasSubstr("the camera has not shown a time code for 5 s: point it at"));
    EXPECT_THAT(run.output(), HasSubstr("error: latency: no time code was seen in "));
}

TEST(Latency, NeedsACameraAndAnOutput) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter}\n");
    ASSERT_EQ(run.run({"latency", "run.yaml"}), 2) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("run.yaml: to measure latency, it needs the camera as 'source'"));
}
