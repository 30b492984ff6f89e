// SPDX-License-Identifier: Apache-2.0
//
// One test for each deadline and delay of the host in real time. CTest runs them one at a time;
// ARHOST_TEST_TIME_SCALE scales their deadlines. core/supervise/component_test.cpp and core/host/frame_flow_test.cpp
// test deadlines in virtual time.
#include "arhost_run.hpp"

#include <gmock/gmock.h>

using namespace arhost::test;
using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::Not;

namespace {

const std::chrono::milliseconds call_deadline = scaled(1s);

std::string text_of(std::chrono::milliseconds time) {
    return std::to_string(time.count());
}

bool is_plain(const CountedLine &line) {
    return line.overlay == "none";
}

} // namespace

TEST(Deadlines, APluginThatHangsInACallIsEnded) {
    CountingRun run({.source = "frames: 40", .raytracer = "hang_at: 20", .deadline = call_deadline});
    ASSERT_EQ(run.run(), 1) << run.output();
    EXPECT_EQ(expect_all_frames(run, 40), std::set<std::uint64_t>{20});
    EXPECT_THAT(run.output(),
                HasSubstr("hung: neither an answer nor progress within " + text_of(call_deadline) + " ms"));
    EXPECT_THAT(run.output(), HasSubstr("error: arhost: 1 frame has no overlay because the raytracer failed"));
}

TEST(Deadlines, ProgressExtendsACallUpToALimit) {
    CountingRun slow({.source = "frames: 3",
                      .raytracer = "reports_progress: true, delay_ms: " + text_of(scaled(900ms)),
                      .deadline = scaled(400ms)});
    ASSERT_EQ(slow.run(), 0) << slow.output();
    EXPECT_EQ(slow.stats()["restarts"]["raytracer"], 0);
    EXPECT_TRUE(expect_all_frames(slow, 3).empty());

    const auto deadline = scaled(100ms);
    CountingRun endless({.source = "frames: 3",
                         .raytracer = "reports_progress: true, delay_ms: 600000",
                         .more = "restart: {quarantine_after: 1}\n",
                         .deadline = deadline});
    ASSERT_EQ(endless.run(), 1) << endless.output();
    EXPECT_THAT(endless.output(), HasSubstr("too slow: no answer within " + text_of(30 * deadline) +
                                            " ms in total, although it reported progress"));
}

// source_file waits for the time of each frame in mode live.
TEST(Deadlines, ASourceThatWaitsForItsNextFrameIsNotHung) {
    ArhostRun run("version: 1\nmode: live\nsource: {plugin: source_file, path: frame.pgm, fps: 0.5, deadline_ms: " +
                  text_of(scaled(500ms)) +
                  ", options: {frames: 2}}\noutputs: [{plugin: sink_counter, path: "
                  "counted.txt}]\nstats: stats.json\n");
    run.write("frame.pgm", "P5 8 8 255\n" + std::string(64, 'a'));
    EXPECT_EQ(run.run(), 0) << run.output();
    EXPECT_EQ(run.stats()["restarts"]["source"], 0);
}

TEST(Deadlines, ASignalCancelsALongFrame) {
    CountingRun run({.source = "frames: 100", .raytracer = "delay_from: 2, delay_ms: 600000", .deadline = 600s});
    run.start();
    ASSERT_TRUE(run.wait_for_lines(2)) << run.output();
    send_signal(run.pid(), SIGINT);
    EXPECT_EQ(run.wait(), 130) << run.output();
    EXPECT_TRUE(run.exists("counted.txt.done")) << run.output();
    EXPECT_TRUE(expect_all_frames(run, 2).empty()) << "the frame in progress is omitted";
}

TEST(Deadlines, AfterASignalTheComponentThatDoesNotStopIsNamed) {
    CountingRun run({.source = "frames: 100", .raytracer = "hang_at: 2", .deadline = 600s});
    run.start({"run.yaml", "--set", "source.stop_deadline_ms=" + text_of(scaled(2s)), "--set",
               "tracker.stop_deadline_ms=1", "--set", "raytracer.stop_deadline_ms=1", "--set",
               "outputs.0.stop_deadline_ms=1"});
    ASSERT_TRUE(run.wait_for_lines(2)) << run.output();
    send_signal(run.pid(), SIGINT);
    EXPECT_EQ(run.wait(), 1) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("after the signal (stop_deadline_ms): raytracer; "));
}

TEST(Deadlines, AHungPluginThatIgnoresSigabrtIsKilled) {
    CountingRun run(
        {.source = "frames: 30", .tracker = "hang_at: 20, ignore_abort: true", .deadline = call_deadline});
    ASSERT_EQ(run.run(), 1) << run.output();
    EXPECT_EQ(expect_all_frames(run, 30), std::set<std::uint64_t>{20});
    const std::string how = run.stats()["crashes"][0]["how"];
    EXPECT_THAT(how, HasSubstr("hung"));
    EXPECT_THAT(how, HasSubstr("ended by arhost in its per-frame call"));
}

// The time of a stopped host does not count. At frame 20, as at Ctrl-Z, the workers continue, and the host reads
// their responses later. At frame 60, as in a frozen container, the workers are stopped, too, and resumed after the
// host.
TEST(Deadlines, NothingHangsIfTheHostIsStopped) {
    CountingRun run({.source = "frames: 120", .raytracer = "delay_ms: 5", .deadline = call_deadline});
    run.start();
    for (const std::size_t frame : {20, 60}) {
        ASSERT_TRUE(run.wait_for_lines(frame)) << run.output();
        const std::vector<pid_t> stopped = frame == 60 ? run.workers() : std::vector<pid_t>();
        for (const pid_t worker : stopped)
            send_signal(worker, SIGSTOP);
        send_signal(run.pid(), SIGSTOP);
        std::this_thread::sleep_for(call_deadline + 500ms);
        const std::uint64_t waits = waits_of(run.pid());
        send_signal(run.pid(), SIGCONT);
        EXPECT_TRUE(frame == 20 || run.eventually([&] { return waits_of(run.pid()) > waits; }));
        for (const pid_t worker : stopped)
            send_signal(worker, SIGCONT);
    }
    ASSERT_EQ(run.wait(), 0) << run.output();
    EXPECT_TRUE(expect_all_frames(run, 120).empty());
    EXPECT_THAT(run.output(), Not(HasSubstr("hung")));
}

TEST(Deadlines, AStartMustReportProgress) {
    CountingRun slow({.source = "frames: 5", .tracker = "start_steps: 25, start_step_ms: 100"});
    const std::string deadline = "tracker.start_deadline_ms=" + text_of(scaled(2s));
    EXPECT_EQ(slow.run({"run.yaml", "--set", deadline}), 0) << slow.output();
    EXPECT_EQ(slow.stats()["restarts"]["tracker"], 0);
    EXPECT_TRUE(expect_all_frames(slow, 5).empty());

    CountingRun hung({.source = "frames: 5",
                      .tracker = "start_steps: 1, start_step_ms: 60000",
                      .more = "restart: {quarantine_after: 2, first_delay_ms: 1}\n"});
    hung.expect({"run.yaml", "--set", deadline}, 1,
                {"did not start within " + text_of(scaled(2s)) + " ms", "it failed 2 times in a row"});
    EXPECT_FALSE(hung.exists("counted.txt"));
}

TEST(Deadlines, AnOutputThatHangsInStopIsEndedAndOthersFinish) {
    const std::string deadline_ms = text_of(scaled(300ms));
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 20}}\n"
                  "outputs:\n- {plugin: sink_counter, path: second.txt, options: {hang_in_stop: true}, "
                  "stop_deadline_ms: " +
                  deadline_ms + "}\n- {plugin: sink_counter, path: counted.txt}\n");
    run.expect(1, {"did not stop within " + deadline_ms + " ms"});
    EXPECT_TRUE(run.exists("counted.txt.done"));
    EXPECT_FALSE(run.exists("second.txt.done"));
    expect_all_frames(run, 20);
}

// After the signal, the source may no longer extend deadline_ms, so the outputs are completed.
TEST(Deadlines, OneSignalEndsARunWhoseSourceWaitsForever) {
    for (const char *plugin : {"source_waiting_live", "source_waiting"}) {
        ArhostRun run("version: 1\nmode: live\nsource: {plugin: " + std::string(plugin) +
                      ", deadline_ms: " + text_of(scaled(400ms)) +
                      ", options: {wait_ms: -1}}\noutputs: [{plugin: sink_counter, path: out/counted.txt}]\n");
        run.start();
        ASSERT_TRUE(run.wait_for_output("waits for a frame")) << run.output();
        send_signal(run.pid(), SIGTERM);
        EXPECT_EQ(run.wait(), 130) << run.output();
        EXPECT_TRUE(run.exists("out/counted.txt.done"));
    }
}

TEST(Deadlines, TheVideoContinuesDuringTheBackOff) {
    CountingRun run({.mode = "live",
                     .source = "frames: 100000",
                     .more = "live: {max_latency_ms: 60000}\n"
                             "restart: {proven_after_frames: 100000, first_delay_ms: " +
                             text_of(scaled(3s)) + "}\n"});
    run.start();
    ASSERT_TRUE(run.wait_for_lines(15)) << run.output();
    send_signal(run.worker("tracker_counter"), SIGKILL);
    EXPECT_TRUE(run.eventually([&] { return std::ranges::count_if(counted(run), is_plain) >= 8; })) << run.output();
    EXPECT_TRUE(run.eventually([&] { return !is_plain(counted(run).back()); })) << run.output();
    send_signal(run.pid(), SIGINT);
    ASSERT_EQ(run.wait(), 130) << run.output();
    expect_own_overlays(counted(run));
}

// The ray tracer hangs at the first frame from `hang_at` on that it receives. When its deadline ends, the source has
// passed `hang_until`, so the restarted ray tracer does not hang again.
TEST(Deadlines, FramesDoNotWaitForAHungRayTracerLongerThanMaxLatency) {
    CountingRun run({.mode = "live",
                     .source = "frames: 100000",
                     .raytracer = "hang_at: 20, hang_until: 30",
                     .more = "live: {max_latency_ms: 150}\n",
                     .deadline = call_deadline});
    run.start();
    EXPECT_TRUE(run.eventually([&] {
        const auto lines = counted(run);
        return std::ranges::any_of(lines, [](const auto &line) { return line.sequence > 30 && !is_plain(line); });
    })) << "overlays must be shown again after the restart: "
        << run.output();
    send_signal(run.pid(), SIGINT);
    ASSERT_EQ(run.wait(), 130) << run.output();
    const auto lines = counted(run);
    expect_own_overlays(lines);
    EXPECT_GE(std::ranges::count_if(lines, is_plain), 5) << "plain video must continue until the deadline";
    EXPECT_GE(run.stats()["restarts"]["raytracer"], 1);
}
