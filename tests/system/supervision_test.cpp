// SPDX-License-Identifier: Apache-2.0
//
// Tests that the video continues if plugins crash, hang or return errors.
#include "arhost_run.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include <algorithm>
#include <array>
#include <cctype>
#include <iterator>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <span>

using namespace arhost::test;
using testing::HasSubstr;

namespace {

using Frames = std::set<std::uint64_t>;

// Returns the processes that tracker_counter has forked. It writes their pids in its own PID namespace.
std::vector<pid_t> forked_children(const ArhostRun &run) {
    const auto pid_namespace = [](const std::string &pid) {
        std::error_code ignored;
        return std::filesystem::read_symlink("/proc/" + pid + "/ns/pid", ignored);
    };
    const auto pid_in_it = [](const std::string &pid) {
        const std::string text = read_file("/proc/" + pid + "/status"), key = "NSpid:";
        std::istringstream line(text.substr(std::min(text.find(key), text.size())));
        std::string last, word;
        for (line >> word; line >> word && word.back() != ':';)
            last = word;
        return last;
    };
    std::istringstream text(run.read("children.txt"));
    const std::set<std::string> written{std::istream_iterator<std::string>(text), {}};
    const auto expected = pid_namespace(std::to_string(run.worker("tracker_counter")));
    std::vector<pid_t> found;
    for (const auto &entry : std::filesystem::directory_iterator("/proc")) {
        const std::string pid = entry.path().filename();
        if (std::isdigit(pid.front()) && pid_namespace(pid) == expected && written.contains(pid_in_it(pid)))
            found.push_back(std::stoi(pid));
    }
    return found;
}

} // namespace

TEST(Supervision, ACrashingFrameIsRetriedOnceThenSkipped) {
    for (const std::string component : {"tracker", "raytracer"}) {
        Counting options{.source = "frames: 60"};
        (component == "tracker" ? options.tracker : options.raytracer) = "crash_at: 20";
        CountingRun run(options);
        ASSERT_EQ(run.run(), 1) << run.output();
        EXPECT_EQ(expect_all_frames(run, 60), Frames{20});
        const auto stats = run.stats();
        EXPECT_EQ(stats["restarts"][component], 2);
        EXPECT_EQ(stats["frames"]["passed_unaugmented"][component], 1);
        ASSERT_EQ(stats["crashes"].size(), 2u);
        const auto &crash = stats["crashes"][0];
        EXPECT_EQ(crash["component"], component);
        EXPECT_EQ(crash["frame"], 20);
        EXPECT_THAT(crash["how"].get<std::string>(), HasSubstr("signal 11"));
        EXPECT_THAT(crash["how"].get<std::string>(), HasSubstr("in its per-frame call"));
        if (component == "tracker") { // it writes text that is not UTF-8
            EXPECT_THAT(crash["log_tail"].get<std::string>(), HasSubstr("last words: \uFFFD"));
        }
    }
}

namespace {

struct Effects {
    int status = 0; // of the run
    std::uint64_t frames = 30;
    Frames plain{}; // the frames without an overlay
    std::map<std::string, int> restarts{};
    std::vector<std::string> log{}; // regular expressions
};
struct Fault {
    const char *name;
    Counting options;
    Effects effects;
    std::vector<std::string> set{}; // more of the configuration
};
void PrintTo(const Fault &fault, std::ostream *stream) {
    *stream << fault.name;
}

Frames from(std::uint64_t first) {
    Frames all;
    for (std::uint64_t frame = first; frame < 30; ++frame)
        all.insert(frame);
    return all;
}

class AFault : public testing::TestWithParam<Fault> {};

} // namespace

TEST_P(AFault, HasOnlyTheseEffects) {
    Counting options = GetParam().options;
    if (options.source.empty())
        options.source = "frames: 30";
    const Effects &effects = GetParam().effects;
    CountingRun run(options);
    std::vector<std::string> arguments{"run.yaml"};
    for (const std::string &key : GetParam().set)
        arguments.insert(arguments.end(), {"--set", key});
    EXPECT_EQ(run.run(arguments), effects.status) << run.output();
    EXPECT_EQ(expect_all_frames(run, effects.frames), effects.plain);
    for (const std::string &text : effects.log)
        EXPECT_THAT(run.output(), testing::ContainsRegex(text));
    if (effects.frames == 0) // a run that could not start has no statistics
        return;
    for (const auto &[component, restarts] : run.stats()["restarts"].items()) {
        const auto expected = effects.restarts.find(component);
        EXPECT_EQ(restarts, expected == effects.restarts.end() ? 0 : expected->second) << component;
    }
}

namespace {

const std::string lost = "error: " + std::to_string(ARHOST_STATUS_ERROR_DEVICE_LOST);
const std::string no_memory = "error: " + std::to_string(ARHOST_STATUS_ERROR_OUT_OF_MEMORY);
const char *const at_once = "restart: {first_delay_ms: 1, quarantine_after: 3}\n";
const char *const first_crash_disables = "restart: {proven_after_frames: 1000, quarantine_after: 1}\n";
const char *const in_future = "contract violation: a frame's capture time is more than a second ahead of the clock";
const std::vector<std::string> disabled = {"it failed 3 times in a row"};

// After a lost device or lack of memory, a new process can reopen the device and has free memory, so the frame is
// retried. Only a frame that fails again has no overlay.
const std::vector<Fault> faults = {
    {"AClosedControlChannel",
     {.source = "frames: 90, delay_ms: 20", .tracker = "close_control_at: 10"},
     {.frames = 90, .restarts = {{"tracker", 1}}, .log = {"closed its control channel"}}},
    {"ACallOfExit", {.tracker = "exit_at: 15"}, {.status = 1, .plain = {15}, .restarts = {{"tracker", 2}}}},
    {"ADisabledTracker",
     {.tracker = "crash_at: 20", .more = first_crash_disables},
     {.status = 1, .plain = from(20), .log = {"the video continues without it"}}},
    {"ADisabledRayTracer",
     {.raytracer = "crash_at: 20", .more = first_crash_disables},
     {.status = 1, .plain = from(20), .log = {"the video continues without it"}}},
    {"SealedMemory", {.tracker = "seal: seal"}, {.restarts = {{"tracker", 1}}}, {"tracker.writes=[.]"}},
    {"MemorySealedAgainstWrites", {.tracker = "seal: write"}, {.restarts = {{"tracker", 1}}}, {"tracker.writes=[.]"}},
    {"AnError", {.tracker = "error_at: 5", .raytracer = "error_at: 8"}, {.status = 1, .plain = {5, 8}}},
    {"ALostDevice",
     {.tracker = "error_at: 15, " + lost, .raytracer = "error_at: 25, " + lost},
     {.status = 1,
      .plain = {15, 25},
      .restarts = {{"tracker", 2}, {"raytracer", 2}},
      .log = {"device lost; .*, at frame 15; restarting it", "device lost; .*, at frame 25; restarting it"}}},
    {"ALackOfMemory",
     {.tracker = "error_at: 15, " + no_memory, .raytracer = "error_at: 25, " + no_memory},
     {.status = 1,
      .plain = {15, 25},
      .restarts = {{"tracker", 2}, {"raytracer", 2}},
      .log = {"out of memory; .*, at frame 15; restarting it", "out of memory; .*, at frame 25; restarting it"}}},
    {"ADeviceThatIsAlwaysLost",
     {.raytracer = "error_after: 0, " + lost, .more = at_once},
     {.status = 1, .plain = from(0), .restarts = {{"raytracer", 2}}, .log = disabled}},
    {"AConstantLackOfMemory",
     {.raytracer = "error_after: 0, " + no_memory, .more = at_once},
     {.status = 1, .plain = from(0), .restarts = {{"raytracer", 2}}, .log = disabled}},
    {"NanInAnObservation",
     {.tracker = "nan_at: 15"},
     {.status = 1,
      .plain = {15},
      .restarts = {{"tracker", 2}},
      .log = {"contract violation: the tracker reports marker 3 with a corner that is not finite"}}},
    // Rejected: compared with it, later correct times would run backwards.
    {"ACaptureTimeInTheFuture",
     {.source = "frames: 30, ahead_ms: 3600000, ahead_at: 15"},
     {.restarts = {{"source", 1}}, .log = {in_future}}},
    {"OnlyCaptureTimesInTheFuture",
     {.source = "frames: 30, ahead_ms: 3600000", .more = at_once},
     {.status = 1, .frames = 0, .log = {in_future, "it failed 3 times in a row"}}},
    {"ACrashAfterTheLastFrame", {.tracker = "crash_in_destroy: true"}, {.log = {"after it had finished"}}},
    // Only sources and outputs may end the run.
    {"Status2",
     {.raytracer = "answer: 2", .more = at_once},
     {.status = 1, .plain = from(0), .restarts = {{"raytracer", 2}}, .log = {"contract violation: its status is 2"}}},
    {"Status3",
     {.raytracer = "answer: 3", .more = at_once},
     {.status = 1, .plain = from(0), .restarts = {{"raytracer", 2}}, .log = {"contract violation: its status is 3"}}},
    {"Status4",
     {.raytracer = "answer: 4", .more = at_once},
     {.status = 1,
      .plain = from(0),
      .restarts = {{"raytracer", 2}},
      .log = {"contract violation: its status is 4"}}}};

} // namespace

INSTANTIATE_TEST_SUITE_P(Supervision, AFault, testing::ValuesIn(faults),
                         [](const auto &info) { return info.param.name; });

TEST(Supervision, ASourceKilledDuringRestartContinues) {
    CountingRun run({.source = "frames: 400, delay_ms: 5", .more = "restart: {first_delay_ms: 1}\n"});
    run.start();
    run.wait_for_lines(20);
    for (int hits = 0; hits < 3 && run.running();) {
        if (const pid_t source = run.worker("source_counter"))
            send_signal(source, SIGKILL);
        while (run.running() && !run.worker("source_counter"))
            if (const pid_t starting = run.worker("arhost-worker")) {
                send_signal(starting, SIGKILL); // kills the source before it has reported whether it can seek
                ++hits;
                break;
            }
        run.wait_for_lines(counted(run).size() + 5);
    }
    ASSERT_EQ(run.wait(), 0) << run.output();
    expect_all_frames(run, 400);
}

TEST(Supervision, DisablingAnOutputLosesNoFrameOfTheOthers) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 60}}\n"
                  "outputs:\n- {plugin: sink_counter, path: counted.txt}\n- {plugin: sink_counter, path: second.txt, "
                  "options: {crash_at: 20}}\nrestart: {proven_after_frames: 1000, quarantine_after: 1}\n");
    EXPECT_EQ(run.run(), 1);
    expect_all_frames(run, 60);
    EXPECT_TRUE(run.exists("counted.txt.done"));
}

TEST(Supervision, ForkedProcessesEndWithTheirWorker) {
    enum class End { worker_dies, launcher_dies, run_stops, host_is_killed };
    for (const End end : {End::worker_dies, End::launcher_dies, End::run_stops, End::host_is_killed}) {
        CountingRun run({.source = "frames: 100000, delay_ms: 1", .tracker = "fork_at: 10"});
        run.start({"--config", "run.yaml", "--set", "tracker.allow=[processes]", "--set", "tracker.writes=[.]"});
        run.wait_for_lines(20);
        const std::vector<pid_t> children = forked_children(run);
        ASSERT_EQ(children.size(), 2u);
        if (end == End::worker_dies)
            send_signal(run.worker("tracker_counter"), SIGKILL);
        else if (end == End::launcher_dies)
            send_signal(run.launcher(), SIGKILL);
        else
            send_signal(run.pid(), end == End::run_stops ? SIGTERM : SIGKILL);
        for (const pid_t child : children) {
            EXPECT_TRUE(eventually([&] { return !is_alive(child); })) << static_cast<int>(end);
            ::kill(child, SIGKILL);
        }
        if (end == End::worker_dies || end == End::launcher_dies) {
            EXPECT_TRUE(run.running());
        }
    }
}

TEST(Supervision, TheFallbackTakesOverFromADeviceThatIsLostRepeatedly) {
    CountingRun run(
        {.source = "frames: 60", .raytracer = "error_after: 8, " + lost, .more = "restart: {first_delay_ms: 1}\n"});
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_GT(run.stats()["restarts"]["raytracer"], 3) << "without a fallback, it is restarted each time";
    ASSERT_EQ(run.run({"--config", "run.yaml", "--set", "raytracer.fallback=rt_counter"}), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("its device was lost 3 times within a minute; falling back to rt_counter"));
    EXPECT_EQ(run.stats()["restarts"]["raytracer"], 3);
    EXPECT_TRUE(expect_all_frames(run, 60).empty());
}

TEST(Supervision, APluginThatNeverWorksFailsTheRun) {
    CountingRun run({.source = "frames: 30",
                     .raytracer = "crash_in_create: true",
                     .more = "restart: {first_delay_ms: 1, quarantine_after: 3}\n"});
    run.expect(1, {"it failed 3 times in a row", "in create"});
    EXPECT_FALSE(run.exists("counted.txt")) << "a run that could not start must not create outputs";
}

TEST(Supervision, TheFallbackReplacesADisabledPlugin) {
    CountingRun run({.source = "frames: 30",
                     .raytracer = "crash_in_create: true",
                     .more = "restart: {first_delay_ms: 1, quarantine_after: 2}\n"});
    // As a fallback, the same plugin has its default options, with which it works.
    run.expect({"--config", "run.yaml", "--set", "raytracer.fallback=rt_counter"}, 0, {"falling back to rt_counter"});
    expect_all_frames(run, 30);
    EXPECT_EQ(run.run({"--config", "run.yaml", "--set", "raytracer.fallback=rt_embree"}), 0) << run.output();
    EXPECT_EQ(run.stats()["crashes"][0]["plugin"], "rt_counter") << "must name the plugin that crashed";
}

TEST(Supervision, KillingWorkersDoesNotChangeTheResult) {
    const std::string yaml = counting({.source = "frames: 400, delay_ms: 1"});
    ArhostRun clean(yaml);
    clean.write("scene.yaml", small_scene);
    ASSERT_EQ(clean.run(), 0);
    ArhostRun run(yaml);
    run.write("scene.yaml", small_scene);
    run.start();
    kill_in_turn(run, {"source_counter", "tracker_counter", "rt_counter", "sink_counter"});
    ASSERT_EQ(run.wait(), 0) << run.output();
    EXPECT_EQ(run.read("counted.txt"), clean.read("counted.txt"));
    for (const char *component : {"source", "tracker", "raytracer", "sink_counter"})
        EXPECT_EQ(run.stats()["restarts"][component], 1) << component;
}

namespace {

// The x coordinates of the marker in the frames in which it was found: tracker_counter reports how many frames it has
// tracked before.
std::vector<double> tracked_before(const ArhostRun &run) {
    std::istringstream lines(run.read("poses.jsonl"));
    std::vector<double> counts;
    for (std::string line; std::getline(lines, line);) {
        const nlohmann::json record = nlohmann::json::parse(line);
        for (const auto &target : record["targets"])
            if (target["age_frames"] == 0)
                counts.push_back(std::round(target["mt"].at(12).get<double>()));
    }
    return counts;
}

std::string with_state(const std::string &source, const std::string &tracker) {
    return "version: 1\nsource: {plugin: source_counter, options: {" + source + "}}\n" +
           "tracker: {plugin: tracker_counter, targets: [{marker: 3, family: tag36h11, side_mm: 80}], options: {" +
           tracker + "}}\n" + "outputs: [{plugin: sink_poses, path: poses.jsonl}]\nstats: stats.json\n" +
           "restart: {first_delay_ms: 1, quarantine_after: 2}\n";
}

std::vector<double> numbers(std::size_t count) {
    std::vector<double> all(count);
    std::iota(all.begin(), all.end(), 0);
    return all;
}

} // namespace

TEST(Supervision, ATrackersStateSurvivesItsWorker) {
    constexpr std::size_t frames = 400;
    for (const char *size : {"8", "100000"}) {
        ArhostRun run(with_state("frames: 400, delay_ms: 1", std::string("state_size: ") + size));
        run.start();
        for (std::size_t lines = 0; lines < frames - 60;) {
            // More lines than frames can be in the pipeline: a frame that two workers die with is given up.
            ASSERT_TRUE(run.wait_for_lines(lines + 40, "poses.jsonl")) << run.output();
            lines = run.lines("poses.jsonl");
            if (const pid_t worker = run.worker("tracker_counter"))
                send_signal(worker, SIGKILL);
        }
        ASSERT_EQ(run.wait(), 0) << run.output();
        EXPECT_EQ(tracked_before(run), numbers(frames));
        EXPECT_GT(run.stats()["restarts"]["tracker"], 3);
    }
}

// The memory of the filter, of the search and of the prediction survives the tracker.
TEST(Supervision, KillingARealTrackerEvery20FramesDoesNotChangeItsPoses) {
    constexpr std::size_t frames = 120;
    for (const std::string tracker : {"tracker_apriltag", "tracker_aruco"}) {
        const std::string yaml =
            "version: 1\nsource: {plugin: source_synthetic, options: {id: 3, width: 320, height: 240, frames: " +
            std::to_string(frames) + "}}\ntracker: {plugin: " + tracker +
            ", filter: adaptive, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}\n"
            "outputs: [{plugin: sink_poses, path: poses.jsonl}]\nstats: stats.json\nrestart: {first_delay_ms: 1}\n";
        ArhostRun clean(yaml), killed(yaml);
        ASSERT_EQ(clean.run(), 0) << clean.output();
        killed.start();
        for (std::size_t next = 20; killed.wait_for_lines(next, "poses.jsonl");
             next = killed.lines("poses.jsonl") + 20)
            if (const pid_t worker = killed.wait_for_worker(tracker))
                send_signal(worker, SIGKILL);
        ASSERT_EQ(killed.wait(), 0) << killed.output();
        EXPECT_GE(killed.stats()["restarts"]["tracker"], 3);
        EXPECT_EQ(killed.read("poses.jsonl"), clean.read("poses.jsonl"));
        EXPECT_GT(killed.stats()["search"]["expected"], 0) << "no frame was searched at expected places only";
    }
}

TEST(Supervision, AFrameThatATrackerCannotProcessLeavesItsStateAsItWas) {
    ArhostRun run(with_state("frames: 40", "state_size: 8, error_at: 20"));
    EXPECT_EQ(run.run(), 1) << run.output();
    EXPECT_EQ(tracked_before(run), numbers(39));
}

TEST(Supervision, AFallbackBeginsWithoutTheStateOfThePluginThatItReplaces) {
    ArhostRun run(with_state("frames: 40", "state_size: 8, crash_at: 20"));
    ASSERT_EQ(run.run({"--config", "run.yaml", "--set", "tracker.fallback=tracker_counter", "--set",
                       "restart.quarantine_after=1"}),
              1)
        << "frame 20 has crashed two workers\n"
        << run.output();
    // The fallback has its default options, with which it has no state.
    std::vector<double> expected = numbers(20);
    expected.resize(39);
    EXPECT_EQ(tracked_before(run), expected);
}

TEST(Supervision, ARejectedResultLeavesTheStateAsItWas) {
    ArhostRun run(with_state("frames: 40", "state_size: 8, nan_at: 20"));
    EXPECT_EQ(run.run(), 1) << run.output();
    EXPECT_EQ(tracked_before(run), numbers(39));
    EXPECT_THAT(run.output(), HasSubstr("contract violation"));
}

namespace {

std::string with_raytracer_state(const std::string &frames, const std::string &raytracer) {
    return "version: 1\nsource: {plugin: source_counter, options: {delay_ms: 1, frames: " + frames + "}}\n" +
           "tracker: {plugin: tracker_counter, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}\n" +
           "raytracer: {plugin: rt_counter, scene: scene.yaml, options: {" + raytracer + "}}\n" +
           "outputs: [{plugin: sink_counter, path: counted.txt}]\nstats: stats.json\n" +
           "restart: {first_delay_ms: 1, quarantine_after: 2}\n";
}

// For each frame with an overlay: how many images rt_counter had rendered before.
std::vector<double> rendered_before(const ArhostRun &run) {
    std::istringstream lines(run.read("counted.txt"));
    std::vector<double> counts;
    std::string frame, pixels, count, overlay;
    while (lines >> frame >> pixels >> count >> overlay)
        if (count != "none")
            counts.push_back(std::stod(count));
    return counts;
}

} // namespace

TEST(Supervision, ARaytracersStateSurvivesItsWorker) {
    constexpr std::size_t frames = 300;
    for (const char *size : {"8", "10000000"}) {
        ArhostRun run(with_raytracer_state("300", std::string("delay_ms: 1, state_size: ") + size));
        run.write("scene.yaml", small_scene);
        run.start();
        for (std::size_t lines = 0; lines < frames - 60;) {
            // More lines than frames can be in the pipeline: a frame that two workers die with is given up.
            ASSERT_TRUE(run.wait_for_lines(lines + 40, "counted.txt")) << run.output();
            lines = run.lines("counted.txt");
            if (const pid_t worker = run.worker("rt_counter"))
                send_signal(worker, SIGKILL);
        }
        ASSERT_EQ(run.wait(), 0) << run.output();
        EXPECT_EQ(rendered_before(run), numbers(frames));
        EXPECT_GT(run.stats()["restarts"]["raytracer"], 3);
    }
}

namespace {

// Returns how many regions of the ray tracer's memory the host has mapped.
std::size_t mapped_regions(const ArhostRun &run) {
    const std::string process = "/proc/" + std::to_string(run.pid());
    send_signal(run.pid(), SIGSTOP); // the kernel does not write the list in one piece
    (void)run.eventually([&] { return status_of(run.pid(), "State").starts_with("T"); });
    std::istringstream maps(read_file(process + "/maps"));
    send_signal(run.pid(), SIGCONT);
    std::set<std::string> inodes;
    std::string addresses, access, offset, device, inode, rest;
    while (maps >> addresses >> access >> offset >> device >> inode && std::getline(maps, rest))
        if (rest.find("memfd:arhost-raytracer") != std::string::npos)
            inodes.insert(inode);
    return inodes.size();
}

} // namespace

// The output is so slow that images of more dead workers would wait for it.
TEST(Supervision, ARaytracerThatDiesAfterEachImagePinsTheMemoryOfTwoDeadWorkers) {
    constexpr std::size_t frames = 25;
    ArhostRun run(with_raytracer_state("25", "state_size: 100000, crash_after: 1"));
    run.write("scene.yaml", small_scene);
    run.start({"--config", "run.yaml", "--set",
               "outputs=[{plugin: sink_counter, path: counted.txt, options: {delay_ms: 100}}]", "--set",
               "restart.proven_after_frames=1"});
    std::size_t most = 0;
    (void)run.eventually([&] {
        most = std::max(most, mapped_regions(run));
        return false;
    });
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_EQ(rendered_before(run), numbers(frames));
    EXPECT_GT(most, 1u);
    EXPECT_LE(most, 3u);
}

// The worker dies while it renders frame 20, after it has written state_after.
TEST(Supervision, AnImageThatKillsItsRaytracerLeavesTheStateAsItWas) {
    ArhostRun run(with_raytracer_state("40", "state_size: 100000, crash_at: 20"));
    run.write("scene.yaml", small_scene);
    EXPECT_EQ(run.run(), 1) << "frame 20 has crashed two workers\n" << run.output();
    EXPECT_EQ(rendered_before(run), numbers(39));
}

TEST(Supervision, AnImageThatARaytracerCannotRenderLeavesItsStateAsItWas) {
    ArhostRun run(with_raytracer_state("40", "state_size: 8, error_at: 20"));
    run.write("scene.yaml", small_scene);
    EXPECT_EQ(run.run(), 1) << run.output();
    EXPECT_EQ(rendered_before(run), numbers(39));
}

TEST(Supervision, AFallbackBeginsWithoutTheStateOfTheRaytracerThatItReplaces) {
    ArhostRun run(with_raytracer_state("40", "state_size: 8, crash_at: 20"));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run({"--config", "run.yaml", "--set", "raytracer.fallback=rt_history", "--set",
                       "restart.quarantine_after=1"}),
              1)
        << "frame 20 has crashed two workers\n"
        << run.output();
    // The fallback has a state of the same size by default.
    std::vector<double> expected = numbers(20);
    std::ranges::copy(numbers(19), std::back_inserter(expected));
    EXPECT_EQ(rendered_before(run), expected);
}

TEST(Supervision, ARaytracerWhoseStateDoesNotFitIntoItsMemoryIsRejected) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "under a sanitizer the sandbox allows all memory";
#endif
    ArhostRun run(with_raytracer_state("4", "state_size: 45000000"));
    run.write("scene.yaml", small_scene);
    EXPECT_EQ(run.run({"--config", "run.yaml", "--set", "raytracer.memory_mb=256"}), 2) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("the ray tracer's state has 42.9 MiB; 3 states and images take "));
    EXPECT_THAT(run.output(), HasSubstr("more than half of the 256 MiB that it may use ('memory_mb')"));
}

TEST(Supervision, ARaytracerWithAnImpossibleStateIsRejected) {
    for (const char *size : {"9223372036854775807", "-1"}) {
        ArhostRun run(with_raytracer_state("4", std::string("state_size: ") + size));
        run.write("scene.yaml", small_scene);
        EXPECT_EQ(run.run(), 2) << run.output();
        EXPECT_THAT(run.output(), HasSubstr("bytes; the limit is 1099511627776"));
    }
}

TEST(Supervision, ATrackerWithTooMuchStateIsRejected) {
    ArhostRun run(with_state("frames: 4", "state_size: 16777217"));
    run.expect(2, {"the tracker's state_size is 16777217 bytes; the limit is 16777216"});
}

// The random times decide what the workers do when a fault occurs. The test does not wait for an event with them.
TEST(Supervision, SurvivesRandomKillsAndStops) {
    constexpr std::uint64_t frames = 3000;
    CountingRun run({.source = "frames: " + std::to_string(frames) + ", delay_ms: 0.5"});
    run.start();
    run.wait_for_lines(20);
    std::minstd_rand random(7);
    std::array<std::string, 4> plugins{"source_counter", "tracker_counter", "rt_counter", "sink_counter"};
    int faults = 0;
    while (run.running()) {
        // Up to three faults in quick succession, each of another plugin, because a frame at which two workers of a
        // component die has no overlay.
        std::ranges::shuffle(plugins, random);
        for (const std::string &plugin : std::span(plugins).first(1 + random() % 3)) {
            if (const pid_t worker = run.worker(plugin)) {
                if (random() % 4 == 0) {
                    send_signal(worker, SIGSTOP);
                    std::this_thread::sleep_for(std::chrono::milliseconds(random() % 20));
                    send_signal(worker, SIGCONT);
                } else {
                    send_signal(worker, SIGKILL);
                }
                ++faults;
            }
            std::this_thread::sleep_for(std::chrono::milliseconds(random() % 40));
        }
        // More frames than can be in the pipeline: every worker processes a frame.
        run.wait_for_lines(counted(run).size() + 40 + random() % 20);
    }
    ASSERT_EQ(run.wait(), 0) << run.output();
    EXPECT_GT(faults, 15);
    expect_all_frames(run, frames);
}

TEST(Supervision, ASinkThatCannotWriteIsDisabledAndOthersContinue) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 50}}\n"
                  "outputs:\n- {plugin: sink_counter, path: counted.txt}\n- {plugin: sink_counter, path: second.txt, "
                  "options: {error_at: 5}}\n");
    EXPECT_EQ(run.run(), 1);
    EXPECT_EQ(counted(run).size(), 50u);
    EXPECT_THAT(run.output(), HasSubstr("cannot write frame 5"));
}

TEST(Supervision, AFailedSourceFrameIsRetriedAndNeverSkipped) {
    CountingRun run({.source = "frames: 60, error_at: 30", .more = "restart: {first_delay_ms: 1}\n"});
    EXPECT_EQ(run.run(), 1) << "the source always fails at frame 30\n" << run.output();
    expect_all_frames(run, 30);
    EXPECT_EQ(run.stats()["counters"]["source"], nlohmann::json({{"delivered", 30}, {"never", 0}}))
        << "the counts of all processes";
    EXPECT_THAT(run.output(), HasSubstr("counted: delivered 30"));
}

TEST(Supervision, ASourceThatDiesNearTheFrameLimitDeliversAllFrames) {
    CountingRun run({.source = "frames: 100, hold_at: 12"});
    run.start({"--config", "run.yaml", "--frames", "14"});
    run.wait_for_lines(12);
    send_signal(run.worker("source_counter"), SIGKILL);
    ASSERT_EQ(run.wait(), 0) << run.output();
    expect_all_frames(run, 14);
}

TEST(Supervision, AClosedWindowEndsTheRunAndOtherOutputsFinish) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 100000}}\n"
                  "outputs:\n- {plugin: sink_counter, path: window.txt, control: [quit], options: {end_at: 20}}\n"
                  "- {plugin: sink_counter, path: counted.txt, options: {delay_ms: 2}}\n");
    EXPECT_EQ(run.run(), 0) << run.output();
    EXPECT_TRUE(run.exists("counted.txt.done"));
    EXPECT_TRUE(run.exists("window.txt.done"));
    EXPECT_THAT(run.output(), HasSubstr("sink_counter: ends the run"));
    expect_all_frames(run, counted(run).size());
}

TEST(Supervision, AnOutputWithoutPermissionToQuitEndsOnlyItself) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 100}}\n"
                  "outputs:\n- {plugin: sink_counter, path: window.txt, options: {end_at: 20}}\n"
                  "- {plugin: sink_counter, path: counted.txt}\n");
    EXPECT_EQ(run.run(), 0) << run.output();
    EXPECT_TRUE(run.exists("window.txt.done"));
    EXPECT_TRUE(run.exists("counted.txt.done"));
    expect_all_frames(run, 100);
    EXPECT_THAT(run.output(), HasSubstr("sink_counter: has ended; the other outputs continue ('control: [quit]' lets "
                                        "it end the run)"));
}

TEST(Supervision, ARunEndsWithItsLastOutput) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 100000}}\n"
                  "outputs:\n- {plugin: sink_counter, path: a.txt, options: {end_at: 20}}\n"
                  "- {plugin: sink_counter, path: counted.txt, options: {end_at: 30}}\n");
    EXPECT_EQ(run.run(), 0) << run.output();
    EXPECT_TRUE(run.exists("a.txt.done"));
    EXPECT_GE(counted(run).size(), 31u);
    EXPECT_LT(counted(run).size(), 1000u);
}

// It has nothing to do until the host needs it.
TEST(Supervision, AStoppedLauncherAffectsNoWorker) {
    CountingRun run({.source = "frames: 400, delay_ms: 5"});
    run.start();
    run.wait_for_lines(20);
    const pid_t launcher = run.launcher();
    send_signal(launcher, SIGSTOP);
    run.wait_for_lines(100);
    EXPECT_EQ(status_of(launcher, "State").substr(0, 1), "T");
    ASSERT_EQ(run.wait(), 0) << run.output();
    expect_all_frames(run, 400);
}

TEST(Supervision, AStoppedLauncherIsResumed) {
    CountingRun run({.source = "frames: 600, delay_ms: 5"});
    run.start();
    run.wait_for_lines(20);
    send_signal(run.launcher(), SIGSTOP);
    send_signal(run.worker("tracker_counter"), SIGKILL);
    ASSERT_EQ(run.wait(std::chrono::seconds(20)), 0) << run.output();
    expect_all_frames(run, 600);
    EXPECT_EQ(run.stats()["restarts"]["tracker"], 1);
}

TEST(Supervision, AStoppedLauncherDoesNotDelayTheEnd) {
    CountingRun run({.source = "frames: 100000, delay_ms: 5", .tracker = "start_steps: 1, start_step_ms: 3000"});
    run.start();
    ASSERT_NE(run.wait_for_worker("tracker_counter"), 0) << run.output();
    send_signal(run.launcher(), SIGSTOP);
    send_signal(run.pid(), SIGINT);
    EXPECT_EQ(run.wait(std::chrono::seconds(20)), 130) << run.output();
}

// Kills the launcher. Its workers die with it, the output's worker while writing. All are restarted by a new
// launcher.
TEST(Supervision, AKilledLauncherIsReplaced) {
    CountingRun run({.source = "frames: 700, delay_ms: 5"});
    run.start();
    for (const std::size_t frames : {20, 60, 100}) {
        run.wait_for_lines(frames);
        send_signal(run.launcher(), SIGKILL);
    }
    ASSERT_EQ(run.wait(), 0) << run.output();
    expect_all_frames(run, 700);
    EXPECT_TRUE(run.exists("counted.txt.done"));
    EXPECT_EQ(run.stats()["restarts"]["tracker"], 3);
    EXPECT_THAT(run.output(), HasSubstr("warning: arhost: the launcher has died, and all workers with it; starting"));
}

// After the host's death, no other process resumes the stopped launcher; only the kernel can.
TEST(Supervision, AKilledHostLeavesNoStoppedProcesses) {
    CountingRun run({.source = "frames: 100000, delay_ms: 1", .tracker = "fork_at: 10"});
    run.start({"--config", "run.yaml", "--set", "tracker.allow=[processes]", "--set", "tracker.writes=[.]"});
    run.wait_for_lines(20);
    std::vector<pid_t> all = forked_children(run);
    ASSERT_EQ(all.size(), 2u);
    for (const pid_t worker : run.workers())
        all.push_back(worker);
    all.push_back(run.launcher());
    ASSERT_GE(all.size(), 7u);
    for (auto pid = all.rbegin(); pid != all.rend(); ++pid)
        send_signal(*pid, SIGSTOP);
    send_signal(run.pid(), SIGKILL);
    for (const pid_t pid : all) {
        EXPECT_TRUE(eventually([&] { return !is_alive(pid); })) << pid;
        ::kill(pid, SIGKILL);
    }
}

TEST(Supervision, TheRunEndsIfNoOutputIsLeft) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 1000000}}\n"
                  "outputs: [{plugin: sink_counter, path: counted.txt, options: {error_at: 5}}]\n");
    EXPECT_EQ(run.run(), 1) << run.output();
}

namespace {

// A camera that is unplugged at frame 3, and plugged in again when the file `camera` exists. quarantine_after would
// disable it after a few milliseconds.
const char *const unplugged_camera = "version: 1\nmode: live\nrestart: {first_delay_ms: 1, quarantine_after: "
                                     "2}\nsource: {plugin: source_waiting_live, "
                                     "reads: [.], options: {wait_ms: 10, unplugged_at: 3, back: camera}}\n"
                                     "outputs: [{plugin: sink_counter, path: counted.txt}]\nstats: stats.json\n";

} // namespace

TEST(Supervision, ALiveSourceWaitsUntilItsCameraIsBack) {
    ArhostRun run(unplugged_camera);
    run.start({"run.yaml", "--frames", "20"});
    ASSERT_TRUE(run.wait_for_output("the camera is not connected; waiting for its device")) << run.output();
    run.write("camera", "");
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("its device is back"));
    EXPECT_EQ(run.stats()["frames"]["in"], 20);
    EXPECT_EQ(run.stats()["restarts"]["source"], 1) << "the attempts to open the camera are no restarts";
}

TEST(Supervision, OneSignalEndsARunWhoseCameraIsUnplugged) {
    ArhostRun run(unplugged_camera);
    run.start();
    ASSERT_TRUE(run.wait_for_output("is not connected; waiting")) << run.output();
    send_signal(run.pid(), SIGTERM);
    EXPECT_EQ(run.wait(), 130) << run.output();
    EXPECT_TRUE(run.exists("counted.txt.done"));
    EXPECT_EQ(run.stats()["frames"]["in"], 3);
}
