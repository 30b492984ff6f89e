// SPDX-License-Identifier: Apache-2.0
//
// Tests that record the camera poses of a run and replay them.
#include "arhost_run.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

using namespace arhost::test;
using testing::AllOf;
using testing::HasSubstr;

namespace {

const std::string scene = arhost::test::source_directory() + "/config/scenes/optix-cs.yaml";

// Returns a configuration of the real plugins for a small synthetic video. The marker is occluded for some frames.
std::string recording(const std::string &frames = "40") {
    return "version: 1\nsource: {plugin: source_synthetic, options: {width: 320, height: 240, frames: " + frames +
           ", occlude_from: 12, occlude_to: 22}}\n"
           "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: "
           "80}]}\n"
           "raytracer: {plugin: rt_embree, scene: " +
           scene +
           "}\noutputs:\n- {plugin: sink_trajectory, path: run.trajectory}\n"
           "- {plugin: sink_images, path: \"recorded/%03d.png\"}\n- {plugin: sink_poses, path: recorded.jsonl}\n";
}

// Returns the same configuration with a trajectory instead of the tracker.
const std::string replay_of_it = "version: 1\nsource: {plugin: source_synthetic, options: {width: 320, height: 240, "
                                 "frames: 100, occlude_from: 12, "
                                 "occlude_to: 22}}\n"
                                 "trajectory: run.trajectory\nraytracer: {plugin: rt_embree, scene: " +
                                 scene +
                                 "}\noutputs:\n- {plugin: sink_trajectory, path: again.trajectory}\n"
                                 "- {plugin: sink_images, path: \"replayed/%03d.png\"}\nstats: stats.json\n";

void expect_same_images(const ArhostRun &run, int frames) {
    for (int frame = 0; frame < frames; ++frame) {
        char name[32];
        std::snprintf(name, sizeof name, "/%03d.png", frame);
        ASSERT_TRUE(run.exists(std::string("recorded") + name));
        ASSERT_TRUE(run.exists(std::string("replayed") + name));
        ASSERT_EQ(run.read(std::string("recorded") + name), run.read(std::string("replayed") + name)) << name;
    }
}

std::vector<nlohmann::json> lines_of(const ArhostRun &run, const std::string &file) {
    std::istringstream text(run.read(file));
    std::vector<nlohmann::json> lines;
    for (std::string line; std::getline(text, line);)
        lines.push_back(nlohmann::json::parse(line));
    return lines;
}

// Records `frames` frames of the *_counter plugins.
void record_counted(ArhostRun &run, int frames, const std::string &tracker = "",
                    const std::string &format = "arhost") {
    run.write("run.yaml", counting({.source = "frames: " + std::to_string(frames), .tracker = tracker}) +
                              "camera: {width: 64, height: 48, fx: 64}\n");
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run({"--config", "run.yaml", "--set",
                       "outputs=[{plugin: sink_trajectory, path: t.txt, options: {format: " + format + "}}]"}),
              0)
        << run.output();
}

} // namespace

TEST(Replay, ReproducesTheRecordedImagesByteForByte) {
    ArhostRun run(recording());
    ASSERT_EQ(run.run(), 0) << run.output();
    run.write("replay.yaml", replay_of_it);
    ASSERT_EQ(run.run({"--config", "replay.yaml"}), 0) << run.output();
    expect_same_images(run, 40);
    EXPECT_FALSE(run.exists("replayed/040.png")) << "the run must end at the end of the trajectory";
    EXPECT_EQ(run.read("again.trajectory"), run.read("run.trajectory"));
    int lost = 0;
    const auto lines = lines_of(run, "run.trajectory");
    ASSERT_EQ(lines.size(), 41u);
    for (std::size_t i = 1; i < lines.size(); ++i)
        lost += lines[i]["eye"].is_null();
    EXPECT_GT(lost, 9);
    EXPECT_EQ(run.stats()["frames"]["augmented"], 40 - lost);
}

TEST(Replay, PipelineOptionRunsTheTrackerButUsesTheRecordedPoses) {
    ArhostRun run(recording());
    ASSERT_EQ(run.run(), 0) << run.output();
    // Without the occlusion, the tracker finds the marker in more frames than in the recorded run.
    run.write("chain.yaml", recording("100") + "stats: recorded.stats.json\n");
    ASSERT_EQ(
        run.run({"replay", "--trajectory", "run.trajectory", "--config", "chain.yaml", "--with-pipeline", "--set",
                 "source.options.occlude_from=-1", "--output", "replayed.jsonl", "--stats", "stats.json"}),
        0)
        << run.output();
    const auto recorded = lines_of(run, "recorded.jsonl"), replayed = lines_of(run, "replayed.jsonl");
    ASSERT_EQ(replayed.size(), 40u);
    for (std::size_t i = 0; i < 40; ++i) {
        EXPECT_EQ(replayed[i]["camera"], recorded[i]["camera"]) << i;
        EXPECT_EQ(replayed[i]["capture_ns"], recorded[i]["capture_ns"]) << i;
        EXPECT_EQ(replayed[i]["targets"].size(), 1u) << i;
    }
    const auto stats = run.stats();
    EXPECT_EQ(stats["stages"]["tracker"]["count"], 40);
    EXPECT_EQ(stats["stages"]["source"]["count"], 40);
    for (const char *process : {"host", "source", "tracker", "raytracer"})
        EXPECT_GT(stats["cpu_seconds"][process], 0.0) << process;
    EXPECT_FALSE(run.exists("recorded.stats.json")) << "the configuration's own outputs are ignored";
}

TEST(Replay, RunsOnlyTheRayTracerByDefault) {
    ArhostRun run;
    record_counted(run, 50, "lost_from: 10, lost_to: 20");
    ASSERT_EQ(run.run({"replay", "--trajectory", "t.txt", "--scene", "scene.yaml", "--raytracer", "rt_counter",
                       "--stats", "stats.json"}),
              0)
        << run.output();
    const auto stats = run.stats();
    EXPECT_EQ(stats["frames"]["in"], 50);
    EXPECT_EQ(stats["frames"]["augmented"], 40);
    EXPECT_EQ(stats["stages"]["raytracer"]["count"], 40);
    EXPECT_FALSE(stats["stages"].contains("source"));
    EXPECT_FALSE(stats["stages"].contains("tracker"));
    EXPECT_EQ(stats["cpu_seconds"].size(), 3u); // host, raytracer, total
    EXPECT_GT(stats["fps"], 0.0);
}

TEST(Replay, UsesABlackBackgroundByDefault) {
    ArhostRun run;
    record_counted(run, 30, "lost_from: 10, lost_to: 20");
    ASSERT_EQ(run.run({"replay", "--trajectory", "t.txt", "--scene", "scene.yaml", "--raytracer", "rt_counter",
                       "--output", "x.txt", "--set", "outputs[0].plugin=sink_counter"}),
              0)
        << run.output();
    const auto lines = counted(run, "x.txt");
    ASSERT_EQ(lines.size(), 30u);
    for (std::uint64_t i = 0; i < 30; ++i) {
        EXPECT_EQ(lines[i].sequence, i);
        EXPECT_EQ(lines[i].video, 0u);
        EXPECT_EQ(lines[i].overlay, i >= 10 && i < 20 ? "none" : std::to_string(i));
    }
}

TEST(Replay, RendersEachRecordedFrameOnceIfTheRecordingDroppedSome) {
    ArhostRun run;
    record_counted(run, 30);
    const std::string whole = run.read("t.txt");
    std::string thinned;
    std::istringstream text(whole);
    int number = 0;
    for (std::string line; std::getline(text, line); ++number)
        if (number < 5 || number % 7 == 0)
            thinned += line + "\n";
    run.write("t.txt", thinned);
    ASSERT_EQ(run.run({"replay", "--trajectory", "t.txt", "--scene", "scene.yaml", "--raytracer", "rt_counter",
                       "--output", "x.txt", "--set", "outputs[0].plugin=sink_counter"}),
              0)
        << run.output();
    std::vector<std::uint64_t> shown;
    for (const auto &line : counted(run, "x.txt")) {
        shown.push_back(line.sequence);
        EXPECT_EQ(line.overlay, std::to_string(line.sequence));
    }
    EXPECT_THAT(shown, testing::ElementsAre(0, 1, 2, 3, 6, 13, 20, 27));
}

TEST(Replay, LiveUsesThePoseOfTheShownFrame) {
    ArhostRun run;
    record_counted(run, 60);
    run.write("live.yaml", "version: 1\nmode: live\ntrajectory: t.txt\n"
                           "source: {plugin: source_counter, options: {frames: 90}, fps: 60}\n"
                           "raytracer: {plugin: rt_counter, scene: scene.yaml, options: {delay_ms: 30}}\n"
                           "outputs: [{plugin: sink_counter, path: x.txt}]\n");
    ASSERT_EQ(run.run({"--config", "live.yaml"}), 0) << run.output();
    const auto lines = counted(run, "x.txt");
    EXPECT_GT(lines.size(), 5u);
    for (const auto &line : lines)
        if (line.overlay != "none") {
            EXPECT_EQ(line.overlay, std::to_string(line.sequence));
        }
    EXPECT_LT(lines.back().sequence, 60u);
}

TEST(Replay, ReadsTheDissertationsFormat) {
    ArhostRun run;
    record_counted(run, 30, "lost_from: 10, lost_to: 20", "dissertation");
    for (const bool cut : {false, true}) {
        if (cut)
            run.write("t.txt", run.read("t.txt") + "0 0 5");
        ASSERT_EQ(run.run({"replay", "--trajectory", "t.txt", "--scene", "scene.yaml", "--raytracer", "rt_counter",
                           "--width", "200", "--height", "100", "--output", "x.trajectory", "--stats", "stats.json",
                           "--set", "outputs[0].plugin=sink_trajectory"}),
                  0)
            << run.output();
        const auto lines = lines_of(run, "x.trajectory");
        ASSERT_EQ(lines.size(), 31u);
        EXPECT_EQ(lines[0]["camera"]["width"], 200);
        EXPECT_NEAR(lines[0]["camera"]["fy"], 120.710678, 1e-6); // 50 px / tan 22.5°
        EXPECT_EQ(lines[0]["camera"]["cy"], 49.5);
        for (const auto &[axis, expected] : {std::pair{0u, 0.0}, {1u, 0.0}, {2u, 529.0}})
            EXPECT_NEAR(lines[30]["eye"][axis], expected, 1e-9);
        EXPECT_TRUE(lines[11]["eye"].is_null());
        EXPECT_EQ(run.stats()["frames"]["augmented"], 20);
        EXPECT_EQ(run.output().find("t.txt:31: the last line is truncated and was ignored") != std::string::npos,
                  cut);
    }
}

TEST(Replay, ReadsTheDissertationsTrajectories) {
    ARHOST_REQUIRE_SHARED_DATA("seed-samples/camPose.txt");
    ArhostRun run;
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run({"replay", "--trajectory", shared_data("seed-samples/camPose.txt"), "--scene", "scene.yaml",
                       "--width", "80", "--height", "60", "--stats", "stats.json"}),
              0)
        << run.output();
    EXPECT_EQ(run.stats()["frames"]["augmented"], 4289);
}

TEST(Replay, PipelineOptionNeedsNoConfiguration) {
    ArhostRun run;
    record_counted(run, 4);
    ASSERT_EQ(run.run({"replay", "--trajectory", "t.txt", "--scene", "scene.yaml", "--with-pipeline", "--frames", "3",
                       "--stats", "stats.json"}),
              0)
        << run.output();
    EXPECT_EQ(run.stats()["frames"]["composited"], 3);
    EXPECT_EQ(run.stats()["stages"]["sink_null"]["count"], 3);
    EXPECT_EQ(run.stats()["stages"]["tracker"]["count"], 3);
}

TEST(Replay, RecordsTheSameTrajectoryIfTheSinkIsKilled) {
    ArhostRun run;
    record_counted(run, 400);
    const std::string expected = run.read("t.txt");
    run.start({"--config", "run.yaml", "--set", "outputs=[{plugin: sink_trajectory, path: killed.txt}]", "--set",
               "raytracer.options.delay_ms=2"});
    for (int kills = 0; kills < 3; ++kills) {
        const std::size_t goal = run.read("killed.txt").size() + 3000;
        EXPECT_TRUE(run.eventually([&] { return run.read("killed.txt").size() >= goal; })) << run.output();
        if (const pid_t worker = run.worker("sink_trajectory"))
            ::kill(worker, SIGKILL);
    }
    ASSERT_EQ(run.wait(), 0) << run.output();
    EXPECT_EQ(run.read("killed.txt"), expected);
}

TEST(Replay, SurvivesARayTracerCrash) {
    ArhostRun run;
    record_counted(run, 60);
    ASSERT_EQ(
        run.run({"replay", "--trajectory", "t.txt", "--scene", "scene.yaml", "--raytracer", "rt_counter", "--output",
                 "x.txt", "--set", "outputs[0].plugin=sink_counter", "--set", "raytracer.options.crash_at=20"}),
        1) // frame 20 has no overlay
        << run.output();
    const auto lines = counted(run, "x.txt");
    ASSERT_EQ(lines.size(), 60u);
    for (std::uint64_t i = 0; i < 60; ++i)
        EXPECT_EQ(lines[i].overlay, i == 20 ? "none" : std::to_string(i));
}

TEST(Replay, FinishesItsFilesOnCtrlCAndExitsWith130) {
    ArhostRun run;
    record_counted(run, 3000);
    for (const bool with_output : {true, false}) {
        std::vector<std::string> arguments = {"replay",
                                              "--trajectory",
                                              "t.txt",
                                              "--scene",
                                              "scene.yaml",
                                              "--raytracer",
                                              "rt_counter",
                                              "--stats",
                                              "stats.json",
                                              "--set",
                                              "raytracer.options.delay_ms=5"};
        if (with_output)
            arguments.insert(arguments.end(), {"--output", "x.txt", "--set", "outputs[0].plugin=sink_counter"});
        run.start(arguments);
        ASSERT_TRUE(with_output ? run.wait_for_lines(20, "x.txt") : run.wait_for_output("frame ")) << run.output();
        ::kill(run.pid(), SIGINT);
        ASSERT_EQ(run.wait(), 130) << run.output();
        const std::uint64_t frames = run.stats()["frames"]["composited"];
        EXPECT_GT(frames, 0u);
        EXPECT_LT(frames, 3000u);
        if (with_output) {
            EXPECT_EQ(counted(run, "x.txt").size(), frames);
            EXPECT_TRUE(run.exists("x.txt.done"));
        }
    }
}

TEST(Replay, RejectsBadInputWithPositionAndFix) {
    ArhostRun run;
    record_counted(run, 5);
    const std::string good = run.read("t.txt");
    run.write("garbage.txt", good.substr(0, good.find('\n') + 1) + "garbage\n" + good.substr(good.find('\n') + 1));
    run.write("empty.txt", "");
    run.write("nan.txt", "1 2 nan 4 5 6 7 8 9\n");
    run.write("plain.txt", "0 0 500 0 0 499 0 1 0 \n");
    run.write("live.yaml", "version: 1\nmode: live\ntrajectory: t.txt\n");
    run.write("tracker.yaml", "version: 1\ntrajectory: t.txt\ntracker: {plugin: tracker_counter, targets: "
                              "[{marker: 3, family: tag36h11, side_mm: 80}]}\n");
    run.write("same.yaml", "version: 1\ntrajectory: t.txt\noutputs: [{plugin: sink_trajectory, path: ./t.txt}]\n");
    run.write("stats.yaml", "version: 1\ntrajectory: t.txt\nstats: t.txt\n");
    run.write("size.yaml", "version: 1\ntrajectory: t.txt\nsource: {plugin: source_counter, options: {width: 32}}\n");
    run.write("nothing.yaml", "version: 1\noutputs: []\n");
    run.write("pure.yaml", "version: 1\nraytracer: {plugin: rt_counter, scene: scene.yaml}\n");
    const auto replay = [](const std::string &trajectory, std::vector<std::string> more = {"--scene", "scene.yaml"}) {
        more.insert(more.begin(), {"replay", "--trajectory", trajectory});
        return more;
    };
    struct {
        std::vector<std::string> arguments;
        const char *expected;
    } const cases[] = {
        {{"replay", "--scene", "scene.yaml"}, "name the folder of a session, or a trajectory with --trajectory FILE"},
        {replay("t.txt", {}), "--scene is missing: the scene to render"},
        {replay("none.txt"), "none.txt: cannot be read: No such file or directory"},
        {replay("."), "is not a regular file"},
        {replay("garbage.txt"), "garbage.txt:2:1: is not valid JSON; delete the line"},
        {replay("empty.txt"), "empty.txt: contains no frames"},
        {replay("nan.txt"), "nan.txt:1:5: 'nan' is not a number"},
        {replay("scene.yaml"), "scene.yaml:1:1: 'version:' is not a number"},
        {replay("t.txt", {"--scene", "none.yaml"}), "--scene: raytracer.scene: there is no scene file"},
        {replay("t.txt", {"--scene", "t.txt"}), "t.txt"},
        {replay("t.txt", {"--scene", "scene.yaml", "--raytracer", "rt_embre"}), "did you mean 'rt_embree'"},
        {replay("t.txt", {"--scene", "scene.yaml", "--raytracer", "sink_null"}), "is a sink, not a raytracer"},
        {replay("t.txt", {"--scene", "scene.yaml", "--width", "64"}), "--width and --height must be given together"},
        {replay("t.txt", {"--scene", "scene.yaml", "--width", "64", "--height", "48"}),
         "contains the image size; remove --width and --height"},
        {replay("plain.txt", {"--scene", "scene.yaml", "--width", "0", "--height", "48"}), "--width"},
        {replay("t.txt", {"--scene", "scene.yaml", "--output", "x"}), "--output x: add an extension"},
        {replay("t.txt", {"--scene", "scene.yaml", "--output", "x.xyz"}), "x.xyz"},
        {replay("t.txt", {"--scene", "scene.yaml", "--output", "t.txt", "--set", "outputs[0].plugin=sink_counter"}),
         "--output: outputs[0].path: 't.txt' is a file that this run reads"},
        {replay("t.txt", {"--scene", "scene.yaml", "--stats", "t.txt"}),
         "--stats: stats: 't.txt' is a file that this run reads"},
        {replay("t.txt", {"--config", "pure.yaml", "--with-pipeline"}),
         "--with-pipeline needs a 'source' and a 'tracker'; pure.yaml lacks at least one of them"},
        {{"--config", "live.yaml"}, "live.yaml:2:7: mode: mode live needs a 'source', which sets the frame rate"},
        {{"--config", "tracker.yaml"}, "tracker.yaml:3:10: tracker: a tracker needs a 'source'"},
        {{"--config", "same.yaml"}, "is a file that this run reads; choose another path"},
        {{"--config", "stats.yaml"}, "stats.yaml:3:8: stats: "},
        {{"--config", "size.yaml"}, "size.yaml:2:13: trajectory: the camera is calibrated for images of 64×48 px"},
        {{"--config", "nothing.yaml"}, "nothing.yaml:1:1: the key 'source' is missing"},
    };
    for (const auto &c : cases) {
        EXPECT_EQ(run.run(c.arguments), 2) << c.expected;
        EXPECT_THAT(run.output(), HasSubstr(c.expected));
        EXPECT_EQ(run.read("t.txt"), good) << c.expected;
    }
}

TEST(Replay, RecordingNeedsACamera) {
    ArhostRun run(recording("2"));
    ASSERT_EQ(run.run(), 0) << run.output();
    run.write("blind.yaml", "version: 1\nsource: {plugin: source_file, path: recorded/000.png}\n"
                            "outputs: [{plugin: sink_trajectory, path: blind.trajectory}]\n");
    EXPECT_EQ(run.run({"--config", "blind.yaml"}), 2);
    EXPECT_THAT(run.output(), AllOf(HasSubstr("blind.yaml:3:"), HasSubstr("there is no camera to record")));
    EXPECT_FALSE(run.exists("blind.trajectory"));
}

TEST(Replay, CanBeChecked) {
    ArhostRun run;
    record_counted(run, 5);
    run.write("replay.yaml", "version: 1\ntrajectory: t.txt\nraytracer: {plugin: rt_counter, scene: scene.yaml}\n");
    EXPECT_EQ(run.run({"check", "replay.yaml"}), 0) << run.output();
    run.write("t.txt", run.read("t.txt") + "{\"frame\"");
    run.expect({"check", "replay.yaml"}, 0, {"t.txt:7: the last line is truncated and was ignored"});
    EXPECT_EQ(run.run({"--config", "replay.yaml"}), 0) << run.output();
}
