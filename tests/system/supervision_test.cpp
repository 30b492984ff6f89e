// SPDX-License-Identifier: Apache-2.0
//
// Tests that the video continues if plugins crash, hang or return errors.
#include "arhost_run.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include <cctype>
#include <iterator>
#include <numeric>
#include <random>
#include <set>

using namespace arhost::test;
using testing::HasSubstr;

namespace {

void expect_all_frames_in_order(const ArhostRun &run, std::uint64_t frames) {
    const auto lines = counted(run);
    ASSERT_EQ(lines.size(), frames) << run.output();
    for (std::uint64_t i = 0; i < frames; ++i) {
        ASSERT_EQ(lines[i].sequence, i);
        ASSERT_EQ(lines[i].video, i);
        if (lines[i].overlay != "none") {
            ASSERT_EQ(lines[i].overlay, std::to_string(i)) << "the overlay belongs to another frame";
        }
    }
}

void wait_for_frames(const ArhostRun &run, std::size_t frames) {
    while (run.running() && counted(run).size() < frames)
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
}

// Returns whether a process has ended. Returns true also for a zombie, because the new parent of an orphan may not
// reap it.
bool is_dead(pid_t pid) {
    const auto lives = [&] {
        std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
        std::string text;
        std::getline(stat, text);
        const std::size_t end_of_name = text.rfind(')');
        return end_of_name != std::string::npos && text.substr(end_of_name).compare(0, 3, ") Z") != 0;
    };
    for (int i = 0; i < 10'000 && lives(); ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    return !lives();
}

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
    struct Case {
        const char *tracker, *raytracer, *component;
    };
    for (const Case &c : {Case{"crash_at: 20", "", "tracker"}, Case{"", "crash_at: 20", "raytracer"}}) {
        ArhostRun run(counting("lockstep", "frames: 60", c.tracker, c.raytracer));
        run.write("scene.yaml", small_scene);
        ASSERT_EQ(run.run(), 1) << run.output();
        expect_all_frames_in_order(run, 60);
        const auto lines = counted(run);
        for (std::uint64_t i = 0; i < 60; ++i)
            EXPECT_EQ(lines[i].overlay == "none", i == 20) << i;
        const auto stats = run.stats();
        EXPECT_EQ(stats["restarts"][c.component], 2);
        EXPECT_EQ(stats["frames"]["passed_unaugmented"][c.component], 1);
        ASSERT_EQ(stats["crashes"].size(), 2u);
        EXPECT_EQ(stats["crashes"][0]["component"], c.component);
        EXPECT_EQ(stats["crashes"][0]["frame"], 20);
        EXPECT_THAT(stats["crashes"][0]["how"].get<std::string>(), HasSubstr("signal 11"));
        EXPECT_THAT(stats["crashes"][0]["how"].get<std::string>(), HasSubstr("in its per-frame call"));
    }
}

TEST(Supervision, AHungPluginIsEndedAfterItsDeadline) {
    ArhostRun run(counting("lockstep", "frames: 40", "", "hang_at: 20"));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run(), 1) << run.output();
    expect_all_frames_in_order(run, 40);
    EXPECT_THAT(run.output(),
                HasSubstr("hung: no answer within " + std::to_string(counting_deadline.count()) + " ms"));
    EXPECT_EQ(counted(run)[20].overlay, "none");
    EXPECT_THAT(run.output(), HasSubstr("error: arhost: 1 frame has no overlay because the raytracer failed"));
}

TEST(Supervision, AHungPluginThatIgnoresSigabrtIsKilled) {
    ArhostRun run(counting("lockstep", "frames: 30", "hang_at: 20, ignore_abort: true", ""));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run(), 1) << run.output();
    expect_all_frames_in_order(run, 30);
    EXPECT_EQ(counted(run)[20].overlay, "none");
    const std::string how = run.stats()["crashes"][0]["how"];
    EXPECT_THAT(how, HasSubstr("hung"));
    EXPECT_THAT(how, HasSubstr("signal 9"));
}

TEST(Supervision, AWorkerThatClosesItsControlChannelIsRestarted) {
    ArhostRun run(counting("lockstep", "frames: 90, delay_ms: 20", "close_control_at: 10", ""));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run(), 0) << run.output();
    expect_all_frames_in_order(run, 90);
    EXPECT_THAT(run.output(), HasSubstr("closed its control channel"));
    EXPECT_EQ(run.stats()["restarts"]["tracker"], 1);
}

TEST(Supervision, ASourceKilledDuringRestartContinues) {
    ArhostRun run(counting("lockstep", "frames: 400, delay_ms: 5", "", "", "restart: {first_delay_ms: 1}\n"));
    run.write("scene.yaml", small_scene);
    run.start();
    wait_for_frames(run, 20);
    for (int hits = 0; hits < 3 && run.running();) {
        if (const pid_t source = run.worker("source_counter"))
            send_signal(source, SIGKILL);
        for (int tries = 0; tries < 10'000 && !run.worker("source_counter"); ++tries)
            if (const pid_t starting = run.worker("arhost-worker")) {
                send_signal(starting, SIGKILL); // kills the source before it has reported whether it can seek
                ++hits;
                break;
            }
        wait_for_frames(run, counted(run).size() + 5);
    }
    ASSERT_EQ(run.wait(), 0) << run.output();
    expect_all_frames_in_order(run, 400);
}

TEST(Supervision, APluginThatCallsExitIsRestarted) {
    ArhostRun run(counting("lockstep", "frames: 30", "exit_at: 15", ""));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run(), 1) << run.output();
    expect_all_frames_in_order(run, 30);
    EXPECT_EQ(counted(run)[15].overlay, "none");
    EXPECT_EQ(run.stats()["restarts"]["tracker"], 2);
}

TEST(Supervision, DisablingABackendLosesNoFrame) {
    struct Case {
        const char *tracker, *raytracer, *component;
    };
    for (const Case &c : {Case{"crash_at: 20", "", "tracker"}, Case{"", "crash_at: 20", "raytracer"}}) {
        ArhostRun run(counting("lockstep", "frames: 60", c.tracker, c.raytracer,
                               "restart: {proven_after_frames: 1000, quarantine_after: 1}\n"));
        run.write("scene.yaml", small_scene);
        EXPECT_EQ(run.run(), 1);
        expect_all_frames_in_order(run, 60);
        const auto lines = counted(run);
        ASSERT_EQ(lines.size(), 60u);
        for (std::uint64_t i = 0; i < 60; ++i)
            EXPECT_EQ(lines[i].overlay == "none", i >= 20) << c.component << " " << i;
        EXPECT_THAT(run.output(), HasSubstr("the video continues without it"));
    }
}

TEST(Supervision, DisablingAnOutputLosesNoFrameOfTheOthers) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 60}}\n"
                  "outputs:\n- {plugin: sink_counter, path: counted.txt}\n- {plugin: sink_counter, path: second.txt, "
                  "options: {crash_at: 20}}\nrestart: {proven_after_frames: 1000, quarantine_after: 1}\n");
    EXPECT_EQ(run.run(), 1);
    expect_all_frames_in_order(run, 60);
    EXPECT_TRUE(run.exists("counted.txt.done"));
}

TEST(Supervision, AWorkerThatSealsItsMemoryIsHarmless) {
    for (const char *seal : {"seal", "write"}) {
        ArhostRun run(
            counting("lockstep", "frames: 30", std::string("seal: ") + seal, "", "restart: {first_delay_ms: 1}\n"));
        run.write("scene.yaml", small_scene);
        ASSERT_EQ(run.run({"--config", "run.yaml", "--set", "tracker.writes=[.]"}), 0) << run.output();
        expect_all_frames_in_order(run, 30);
        EXPECT_EQ(run.stats()["restarts"]["tracker"], 1) << seal;
        EXPECT_EQ(run.stats()["frames"]["augmented"], 30) << seal;
    }
}

TEST(Supervision, ForkedProcessesEndWithTheirWorker) {
    const std::string yaml = counting("lockstep", "frames: 100000, delay_ms: 1", "fork_at: 10", "");
    enum class End { worker_dies, launcher_dies, run_stops, host_is_killed };
    for (const End end : {End::worker_dies, End::launcher_dies, End::run_stops, End::host_is_killed}) {
        ArhostRun run(yaml);
        run.write("scene.yaml", small_scene);
        run.start({"--config", "run.yaml", "--set", "tracker.allow=[processes]", "--set", "tracker.writes=[.]"});
        wait_for_frames(run, 20);
        const std::vector<pid_t> children = forked_children(run);
        ASSERT_EQ(children.size(), 2u);
        if (end == End::worker_dies)
            send_signal(run.worker("tracker_counter"), SIGKILL);
        else if (end == End::launcher_dies)
            send_signal(run.launcher(), SIGKILL);
        else
            send_signal(run.pid(), end == End::run_stops ? SIGTERM : SIGKILL);
        for (const pid_t child : children) {
            EXPECT_TRUE(is_dead(child)) << static_cast<int>(end);
            ::kill(child, SIGKILL);
        }
        if (end == End::worker_dies || end == End::launcher_dies) {
            EXPECT_TRUE(run.running());
        }
    }
}

TEST(Supervision, StderrOfACrashedPluginNeedNotBeUtf8) {
    ArhostRun run(counting("lockstep", "frames: 30", "crash_at: 20", ""));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run(), 1) << run.output();
    EXPECT_THAT(run.stats()["crashes"][0]["log_tail"].get<std::string>(), HasSubstr("last words: \uFFFD"));
}

// Stops the host for longer than a timeout, as Ctrl-Z does. The workers continue, and the host reads their responses
// later.
TEST(Supervision, NothingHangsIfTheHostIsStopped) {
    ArhostRun run(counting("lockstep", "frames: 120", "", "delay_ms: 5"));
    run.write("scene.yaml", small_scene);
    run.start();
    for (const std::size_t frame : {20, 60}) {
        wait_for_frames(run, frame);
        send_signal(run.pid(), SIGSTOP);
        std::this_thread::sleep_for(counting_deadline + std::chrono::milliseconds(500));
        send_signal(run.pid(), SIGCONT);
    }
    ASSERT_EQ(run.wait(), 0) << run.output();
    expect_all_frames_in_order(run, 120);
    EXPECT_THAT(run.output(), testing::Not(HasSubstr("hung")));
    EXPECT_EQ(run.stats()["frames"]["augmented"], 120);
}

// Stops the host and the workers, as when a container is frozen. The host may be resumed before the workers.
TEST(Supervision, NothingHangsIfAllProcessesAreStopped) {
    ArhostRun run(counting("lockstep", "frames: 100", "", "delay_ms: 5"));
    run.write("scene.yaml", small_scene);
    run.start();
    wait_for_frames(run, 20);
    const std::vector<pid_t> workers = run.workers();
    for (const pid_t worker : workers)
        send_signal(worker, SIGSTOP);
    send_signal(run.pid(), SIGSTOP);
    std::this_thread::sleep_for(counting_deadline + std::chrono::milliseconds(500));
    send_signal(run.pid(), SIGCONT);
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    for (const pid_t worker : workers)
        send_signal(worker, SIGCONT);
    ASSERT_EQ(run.wait(), 0) << run.output();
    expect_all_frames_in_order(run, 100);
    EXPECT_THAT(run.output(), testing::Not(HasSubstr("hung")));
}

TEST(Supervision, AFrameWithAnErrorIsSkippedWithoutARestart) {
    ArhostRun run(counting("lockstep", "frames: 30", "error_at: 5", "error_at: 8"));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run(), 1) << run.output();
    expect_all_frames_in_order(run, 30);
    EXPECT_EQ(counted(run)[5].overlay, "none");
    EXPECT_EQ(counted(run)[8].overlay, "none");
    EXPECT_EQ(run.stats()["restarts"]["tracker"], 0);
    EXPECT_EQ(run.stats()["restarts"]["raytracer"], 0);
}

// After a lost device or lack of memory, a new process can reopen the device and has free memory, so the frame is
// retried. Only a frame that fails again has no overlay.
class FatalError : public testing::TestWithParam<std::pair<arhost_status, const char *>> {};
INSTANTIATE_TEST_SUITE_P(Statuses, FatalError,
                         testing::Values(std::pair(ARHOST_STATUS_ERROR_DEVICE_LOST, "device lost"),
                                         std::pair(ARHOST_STATUS_ERROR_OUT_OF_MEMORY, "out of memory")));

TEST_P(FatalError, RestartsTheWorker) {
    const std::string error = ", error: " + std::to_string(GetParam().first);
    ArhostRun run(counting("lockstep", "frames: 40", "error_at: 15" + error, "error_at: 25" + error));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run(), 1) << run.output();
    expect_all_frames_in_order(run, 40);
    EXPECT_THAT(run.output(),
                testing::ContainsRegex(GetParam().second + std::string("; .*, at frame 15; restarting it")));
    EXPECT_THAT(run.output(),
                testing::ContainsRegex(GetParam().second + std::string("; .*, at frame 25; restarting it")));
    for (const CountedLine &line : counted(run))
        EXPECT_EQ(line.overlay == "none", line.sequence == 15 || line.sequence == 25) << line.sequence;
    for (const char *component : {"tracker", "raytracer"})
        EXPECT_EQ(run.stats()["restarts"][component], 2) << component << ": the frame is retried once";
}

TEST_P(FatalError, DisablesThePluginIfEveryFrameFails) {
    ArhostRun run(counting("lockstep", "frames: 40", "", "answer: " + std::to_string(GetParam().first),
                           "restart: {first_delay_ms: 1, quarantine_after: 3}\n"));
    run.write("scene.yaml", small_scene);
    EXPECT_EQ(run.run(), 1) << run.output();
    expect_all_frames_in_order(run, 40);
    EXPECT_THAT(run.output(), HasSubstr("it failed 3 times in a row"));
}

TEST(Supervision, TheFallbackTakesOverFromADeviceThatIsLostRepeatedly) {
    const std::string losses = "error_after: 8, error: " + std::to_string(ARHOST_STATUS_ERROR_DEVICE_LOST);
    ArhostRun run(counting("lockstep", "frames: 60", "", losses, "restart: {first_delay_ms: 1}\n"));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_GT(run.stats()["restarts"]["raytracer"], 3) << "without a fallback, it is restarted each time";
    ASSERT_EQ(run.run({"--config", "run.yaml", "--set", "raytracer.fallback=rt_counter"}), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("its device was lost 3 times within a minute; falling back to rt_counter"));
    EXPECT_EQ(run.stats()["restarts"]["raytracer"], 3);
    expect_all_frames_in_order(run, 60);
    for (const CountedLine &line : counted(run))
        EXPECT_EQ(line.overlay, std::to_string(line.sequence));
}

TEST(Supervision, ATrackerThatReportsNanIsEnded) {
    ArhostRun run(counting("lockstep", "frames: 30", "nan_at: 15", ""));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run(), 1) << run.output();
    expect_all_frames_in_order(run, 30);
    EXPECT_THAT(run.output(),
                HasSubstr("contract violation: the tracker reports marker 3 with a corner that is not finite"));
    EXPECT_EQ(counted(run)[15].overlay, "none");
}

TEST(Supervision, APluginThatNeverWorksFailsTheRun) {
    ArhostRun run(counting("lockstep", "frames: 30", "", "crash_in_create: true",
                           "restart: {first_delay_ms: 1, quarantine_after: 3}\n"));
    run.write("scene.yaml", small_scene);
    EXPECT_EQ(run.run(), 1);
    EXPECT_THAT(run.output(), HasSubstr("it failed 3 times in a row"));
    EXPECT_THAT(run.output(), HasSubstr("in create"));
    EXPECT_FALSE(run.exists("counted.txt")) << "a run that could not start must not create outputs";
}

TEST(Supervision, TheFallbackReplacesADisabledPlugin) {
    ArhostRun run(counting("lockstep", "frames: 30", "", "crash_in_create: true",
                           "restart: {first_delay_ms: 1, quarantine_after: 2}\n"));
    run.write("scene.yaml", small_scene);
    // As a fallback, the same plugin has its default options, with which it works.
    EXPECT_EQ(run.run({"--config", "run.yaml", "--set", "raytracer.fallback=rt_counter"}), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("falling back to rt_counter"));
    expect_all_frames_in_order(run, 30);
    EXPECT_EQ(run.run({"--config", "run.yaml", "--set", "raytracer.fallback=rt_embree"}), 0) << run.output();
    EXPECT_EQ(run.stats()["crashes"][0]["plugin"], "rt_counter") << "must name the plugin that crashed";
}

TEST(Supervision, KillingWorkersDoesNotChangeTheResult) {
    const std::string yaml = counting("lockstep", "frames: 400, delay_ms: 1", "", "");
    ArhostRun clean(yaml);
    clean.write("scene.yaml", small_scene);
    ASSERT_EQ(clean.run(), 0);
    ArhostRun run(yaml);
    run.write("scene.yaml", small_scene);
    run.start();
    std::size_t at = 0;
    for (const char *plugin : {"source_counter", "tracker_counter", "rt_counter", "sink_counter"}) {
        wait_for_frames(run, at += 60);
        const pid_t worker = run.worker(plugin);
        ASSERT_NE(worker, 0) << plugin << "\n" << run.output();
        send_signal(worker, SIGKILL);
    }
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
            const std::string log = run.exists("poses.jsonl") ? run.read("poses.jsonl") : "";
            if (const auto now = static_cast<std::size_t>(std::ranges::count(log, '\n')); now >= lines + 40) {
                lines = now;
                if (const pid_t worker = run.worker("tracker_counter"))
                    send_signal(worker, SIGKILL);
            }
            ASSERT_TRUE(run.running() || lines >= frames - 60) << run.output();
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
        for (std::size_t next = 20; killed.running(); std::this_thread::sleep_for(std::chrono::milliseconds(1))) {
            const std::string log = killed.exists("poses.jsonl") ? killed.read("poses.jsonl") : "";
            const auto now = static_cast<std::size_t>(std::ranges::count(log, '\n'));
            const pid_t worker = now >= next ? killed.worker(tracker) : 0;
            if (worker == 0)
                continue;
            send_signal(worker, SIGKILL);
            next = now + 20;
        }
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

TEST(Supervision, ATrackerWithTooMuchStateIsRejected) {
    ArhostRun run(with_state("frames: 4", "state_size: 16777217"));
    EXPECT_EQ(run.run(), 2) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("the tracker's state_size is 16777217 bytes; the limit is 16777216"));
}

TEST(Supervision, SurvivesRandomKillsAndStops) {
    constexpr std::uint64_t frames = 3000;
    ArhostRun run(counting("lockstep", "frames: " + std::to_string(frames) + ", delay_ms: 0.5", "", ""));
    run.write("scene.yaml", small_scene);
    run.start();
    wait_for_frames(run, 20);
    std::minstd_rand random(7);
    const std::string plugins[] = {"source_counter", "tracker_counter", "rt_counter", "sink_counter"};
    int faults = 0;
    while (run.running()) {
        // Up to three faults in quick succession: a worker that fails five times in a row is disabled.
        for (std::uint32_t burst = 1 + random() % 3; burst > 0; --burst) {
            if (const pid_t worker = run.worker(plugins[random() % 4])) {
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
        wait_for_frames(run, counted(run).size() + 40 + random() % 20);
    }
    ASSERT_EQ(run.wait(), 0) << run.output();
    EXPECT_GT(faults, 15);
    expect_all_frames_in_order(run, frames);
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
    ArhostRun run(counting("lockstep", "frames: 60, error_at: 30", "", "", "restart: {first_delay_ms: 1}\n"));
    run.write("scene.yaml", small_scene);
    EXPECT_EQ(run.run(), 1) << "the source always fails at frame 30\n" << run.output();
    expect_all_frames_in_order(run, 30);
    EXPECT_EQ(run.stats()["counters"]["source"], nlohmann::json({{"delivered", 30}, {"never", 0}}))
        << "the counts of all processes";
    EXPECT_THAT(run.output(), HasSubstr("counted: delivered 30"));
}

// Capture times in the future must be rejected: compared with them, later correct times would run backwards.
TEST(Supervision, ACaptureTimeInTheFutureCausesARestartWithoutLosingFrames) {
    ArhostRun run(counting("lockstep", "frames: 30, ahead_ms: 3600000, ahead_at: 15", "", ""));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run(), 0) << run.output();
    expect_all_frames_in_order(run, 30);
    EXPECT_THAT(run.output(), HasSubstr("contract violation: a frame's capture time is more than a second ahead"));
    EXPECT_EQ(run.stats()["restarts"]["source"], 1);
}

TEST(Supervision, ASourceWithOnlyFutureCaptureTimesIsDisabled) {
    ArhostRun run(counting("lockstep", "frames: 30, ahead_ms: 3600000", "", "",
                           "restart: {first_delay_ms: 1, quarantine_after: 3}\n"));
    run.write("scene.yaml", small_scene);
    EXPECT_EQ(run.run(), 1);
    EXPECT_THAT(run.output(), HasSubstr("a frame's capture time is more than a second ahead of the clock"));
    EXPECT_THAT(run.output(), HasSubstr("it failed 3 times in a row"));
}

TEST(Supervision, ASourceThatDiesNearTheFrameLimitDeliversAllFrames) {
    ArhostRun run(counting("lockstep", "frames: 100, hold_at: 12", "", ""));
    run.write("scene.yaml", small_scene);
    run.start({"--config", "run.yaml", "--frames", "14"});
    wait_for_frames(run, 12);
    send_signal(run.worker("source_counter"), SIGKILL);
    ASSERT_EQ(run.wait(), 0) << run.output();
    expect_all_frames_in_order(run, 14);
}

TEST(Supervision, AClosedWindowEndsTheRunAndOtherOutputsFinish) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 100000}}\n"
                  "outputs:\n- {plugin: sink_counter, path: window.txt, control: [quit], options: {end_at: 20}}\n"
                  "- {plugin: sink_counter, path: counted.txt, options: {delay_ms: 2}}\n");
    EXPECT_EQ(run.run(), 0) << run.output();
    EXPECT_TRUE(run.exists("counted.txt.done"));
    EXPECT_TRUE(run.exists("window.txt.done"));
    EXPECT_THAT(run.output(), HasSubstr("sink_counter: ends the run"));
    expect_all_frames_in_order(run, counted(run).size());
}

TEST(Supervision, AnOutputWithoutPermissionToQuitEndsOnlyItself) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 100}}\n"
                  "outputs:\n- {plugin: sink_counter, path: window.txt, options: {end_at: 20}}\n"
                  "- {plugin: sink_counter, path: counted.txt}\n");
    EXPECT_EQ(run.run(), 0) << run.output();
    EXPECT_TRUE(run.exists("window.txt.done"));
    EXPECT_TRUE(run.exists("counted.txt.done"));
    expect_all_frames_in_order(run, 100);
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

TEST(Supervision, AWorkerThatDiesAfterFinishingIsNotRestarted) {
    ArhostRun run(counting("lockstep", "frames: 30", "crash_in_destroy: true", ""));
    run.write("scene.yaml", small_scene);
    EXPECT_EQ(run.run(), 0) << run.output();
    expect_all_frames_in_order(run, 30);
    EXPECT_EQ(run.stats()["restarts"]["tracker"], 0);
    EXPECT_THAT(run.output(), HasSubstr("after it had finished"));
}

TEST(Supervision, AStartWithProgressMayExceedItsDeadline) {
    ArhostRun run(counting("lockstep", "frames: 5", "start_steps: 50, start_step_ms: 100", ""));
    run.write("scene.yaml", small_scene);
    EXPECT_EQ(run.run({"--config", "run.yaml", "--set", "tracker.start_deadline_ms=4000"}), 0) << run.output();
    EXPECT_EQ(run.stats()["restarts"]["tracker"], 0);
    expect_all_frames_in_order(run, 5);
}

TEST(Supervision, AStartWithoutProgressIsAHang) {
    ArhostRun run(counting("lockstep", "frames: 5", "start_steps: 1, start_step_ms: 60000", "",
                           "restart: {quarantine_after: 2, first_delay_ms: 1}\n"));
    run.write("scene.yaml", small_scene);
    EXPECT_EQ(run.run({"--config", "run.yaml", "--set", "tracker.start_deadline_ms=500"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("did not start within 500 ms"));
    EXPECT_THAT(run.output(), HasSubstr("it failed 2 times in a row"));
    EXPECT_FALSE(run.exists("counted.txt"));
}

TEST(Supervision, AnOutputThatHangsInStopIsEndedAndOthersFinish) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 20}}\n"
                  "outputs:\n- {plugin: sink_counter, path: second.txt, options: {hang_in_stop: true}, "
                  "stop_deadline_ms: 300}\n- {plugin: sink_counter, path: counted.txt}\n");
    EXPECT_EQ(run.run(), 1);
    EXPECT_THAT(run.output(), HasSubstr("did not stop within 300 ms"));
    EXPECT_TRUE(run.exists("counted.txt.done"));
    EXPECT_FALSE(run.exists("second.txt.done"));
    expect_all_frames_in_order(run, 20);
}

TEST(Supervision, AStoppedLauncherIsResumed) {
    ArhostRun run(counting("lockstep", "frames: 600, delay_ms: 5", "", ""));
    run.write("scene.yaml", small_scene);
    run.start();
    wait_for_frames(run, 20);
    send_signal(run.launcher(), SIGSTOP);
    send_signal(run.worker("tracker_counter"), SIGKILL);
    ASSERT_EQ(run.wait(std::chrono::seconds(20)), 0) << run.output();
    expect_all_frames_in_order(run, 600);
    EXPECT_EQ(run.stats()["restarts"]["tracker"], 1);
}

TEST(Supervision, AStoppedLauncherDoesNotDelayTheEnd) {
    ArhostRun run(counting("lockstep", "frames: 100000, delay_ms: 5", "start_steps: 1, start_step_ms: 3000", ""));
    run.write("scene.yaml", small_scene);
    run.start();
    while (run.running() && run.worker("tracker_counter") == 0)
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    send_signal(run.launcher(), SIGSTOP);
    send_signal(run.pid(), SIGINT);
    EXPECT_EQ(run.wait(std::chrono::seconds(20)), 130) << run.output();
}

// Kills the launcher. Its workers die with it, the output's worker while writing. All are restarted by a new
// launcher.
TEST(Supervision, AKilledLauncherIsReplaced) {
    ArhostRun run(counting("lockstep", "frames: 700, delay_ms: 5", "", ""));
    run.write("scene.yaml", small_scene);
    run.start();
    for (const std::size_t frames : {20, 60, 100}) {
        wait_for_frames(run, frames);
        send_signal(run.launcher(), SIGKILL);
    }
    ASSERT_EQ(run.wait(std::chrono::seconds(30)), 0) << run.output();
    expect_all_frames_in_order(run, 700);
    EXPECT_TRUE(run.exists("counted.txt.done"));
    EXPECT_EQ(run.stats()["restarts"]["tracker"], 3);
    EXPECT_THAT(run.output(), HasSubstr("warning: arhost: the launcher has died, and all workers with it; starting"));
}

// After the host's death, no other process resumes the stopped launcher; only the kernel can.
TEST(Supervision, AKilledHostLeavesNoStoppedProcesses) {
    ArhostRun run(counting("lockstep", "frames: 100000, delay_ms: 1", "fork_at: 10", ""));
    run.write("scene.yaml", small_scene);
    run.start({"--config", "run.yaml", "--set", "tracker.allow=[processes]", "--set", "tracker.writes=[.]"});
    wait_for_frames(run, 20);
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
        EXPECT_TRUE(is_dead(pid)) << pid;
        ::kill(pid, SIGKILL);
    }
}

TEST(Supervision, OnlySourcesAndOutputsMayEndTheRun) {
    for (const char *status : {"2", "3", "4"}) {
        ArhostRun run(counting("lockstep", "frames: 30", "", std::string("answer: ") + status,
                               "restart: {first_delay_ms: 1, quarantine_after: 2}\n"));
        run.write("scene.yaml", small_scene);
        EXPECT_EQ(run.run(), 1) << run.output();
        EXPECT_THAT(run.output(), HasSubstr(std::string("contract violation: its status is ") + status));
        expect_all_frames_in_order(run, 30);
    }
}

TEST(Supervision, TheRunEndsIfNoOutputIsLeft) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 1000000}}\n"
                  "outputs: [{plugin: sink_counter, path: counted.txt, options: {error_at: 5}}]\n");
    EXPECT_EQ(run.run(), 1) << run.output();
}

// After the signal, the source may no longer extend deadline_ms, so the outputs are completed.
TEST(Supervision, OneSignalEndsARunWhoseLiveSourceWaitsForever) {
    ArhostRun run("version: 1\nmode: live\nsource: {plugin: source_waiting_live, deadline_ms: 400, "
                  "options: {wait_ms: -1}}\noutputs: [{plugin: sink_counter, path: out/counted.txt}]\n");
    run.start();
    while (run.running() && !run.worker("source_waiting_live"))
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    std::this_thread::sleep_for(std::chrono::seconds(2)); // several times deadline_ms
    EXPECT_THAT(run.output(), Not(HasSubstr("hung")));
    send_signal(run.pid(), SIGTERM);
    EXPECT_EQ(run.wait(), 130) << run.output();
    EXPECT_TRUE(run.exists("out/counted.txt.done"));
}

namespace {

// A camera that is unplugged at frame 3 and plugged in again at a time of CLOCK_MONOTONIC; -1: never.
std::string unplugged_camera(const std::string &plugin, std::int64_t back_at_ms) {
    return "version: 1\nmode: live\nrestart: {first_delay_ms: 1, quarantine_after: 2}\nsource: {plugin: " + plugin +
           ", options: {wait_ms: 10, unplugged_at: 3, back_at: " + std::to_string(back_at_ms) +
           "}}\noutputs: [{plugin: sink_counter, path: counted.txt}]\nstats: stats.json\n";
}

std::int64_t monotonic_ms() {
    return std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

} // namespace

// quarantine_after would disable it after a few milliseconds.
TEST(Supervision, ALiveSourceWaitsUntilItsCameraIsBack) {
    ArhostRun run(unplugged_camera("source_waiting_live", monotonic_ms() + 3000) + "frames: 20\n");
    EXPECT_EQ(run.run(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("the camera is not connected; waiting for its device"));
    EXPECT_THAT(run.output(), HasSubstr("its device is back"));
    EXPECT_EQ(run.stats()["frames"]["in"], 20);
    EXPECT_EQ(run.stats()["restarts"]["source"], 1) << "the attempts to open the camera are no restarts";
}

TEST(Supervision, OneSignalEndsARunWhoseCameraIsUnplugged) {
    ArhostRun run(unplugged_camera("source_waiting_live", -1));
    run.start();
    while (run.running() && run.output().find("is not connected; waiting") == std::string::npos)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    send_signal(run.pid(), SIGTERM);
    EXPECT_EQ(run.wait(), 130) << run.output();
    EXPECT_TRUE(run.exists("counted.txt.done"));
    EXPECT_EQ(run.stats()["frames"]["in"], 3);
}
