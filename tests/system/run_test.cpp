// SPDX-License-Identifier: Apache-2.0
//
// Tests of complete runs in mode lockstep.
#include "arhost_run.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <sys/stat.h>

using namespace arhost::test;
using testing::HasSubstr;
using testing::Not;

namespace {

void expect_every_frame_augmented(const ArhostRun &run, std::uint64_t frames) {
    EXPECT_TRUE(expect_all_frames(run, frames).empty());
}

} // namespace

TEST(Run, ProcessesEveryFrameInOrder) {
    CountingRun run({.source = "frames: 300"});
    ASSERT_EQ(run.run(), 0) << run.output();
    expect_every_frame_augmented(run, 300);
    const auto stats = run.stats();
    EXPECT_EQ(stats["frames"]["in"], 300);
    EXPECT_EQ(stats["frames"]["tracked"], 300);
    EXPECT_EQ(stats["frames"]["composited"], 300);
    for (const char *stage : {"source", "tracker", "raytracer", "composite", "latency"}) {
        const auto &times = stats["stages"][stage];
        EXPECT_EQ(times["count"], 300) << stage;
        EXPECT_GT(times["p50_ms"], 0.0) << stage;
        EXPECT_LE(times["p50_ms"], times["p95_ms"]) << stage;
        EXPECT_LE(times["p95_ms"], times["p99_ms"]) << stage;
        EXPECT_LE(times["p99_ms"], times["max_ms"]) << stage;
    }
    EXPECT_EQ(stats["restarts"]["tracker"], 0);
    double sum = 0;
    for (const char *process : {"host", "source", "tracker", "raytracer", "sink_counter"}) {
        EXPECT_GT(stats["cpu_seconds"][process], 0.0) << process;
        sum += stats["cpu_seconds"][process].get<double>();
    }
    EXPECT_NEAR(stats["cpu_seconds"]["total"], sum, 1e-9);
    EXPECT_GT(stats["fps"], 0.0);
}

TEST(Run, WritesATimeline) {
    CountingRun run({.source = "frames: 20",
                     .tracker = "lost_from: 5, lost_to: 8",
                     .raytracer = "device_time_ns: 2",
                     .more = "timeline: times.csv\n"});
    ASSERT_EQ(run.run(), 0) << run.output();
    std::istringstream lines(run.read("times.csv"));
    std::string line;
    std::getline(lines, line);
    EXPECT_EQ(line, "frame,shown_s,source_ms,tracker_ms,raytracer_ms,device_ms,composite_ms,latency_ms");
    double before = 0;
    unsigned long long count = 0;
    for (; std::getline(lines, line); ++count) {
        unsigned long long frame = 0;
        double shown, source, tracker, raytracer, device, composite, latency;
        ASSERT_EQ(std::sscanf(line.c_str(), "%llu,%lf,%lf,%lf,%lf,%lf,%lf,%lf", &frame, &shown, &source, &tracker,
                              &raytracer, &device, &composite, &latency),
                  8)
            << line;
        EXPECT_EQ(frame, count);
        EXPECT_GT(shown, before);
        before = shown;
        EXPECT_GT(tracker, 0) << line;
        EXPECT_EQ(raytracer > 0, frame < 5 || frame >= 8) << line;
        EXPECT_EQ(device, raytracer > 0 ? 2e-6 : 0) << line;
        EXPECT_GE(latency, composite) << line;
    }
    EXPECT_EQ(count, 20u);
    EXPECT_EQ(run.stats()["stages"]["device"]["count"], 17);
    EXPECT_NEAR(run.stats()["stages"]["device"]["max_ms"], 2e-6, 1e-12);
}

TEST(Run, ShowsAFilmAtItsOwnRateIfPaced) {
    CountingRun run({.source = "frames: 10", .more = "paced: true\ntimeline: times.csv\n"});
    ASSERT_EQ(run.run({"run.yaml", "--set", "source.fps=20"}), 0) << run.output();
    const std::vector<double> shown = shown_seconds(run.read("times.csv"));
    ASSERT_EQ(shown.size(), 10u);
    for (std::size_t i = 0; i < shown.size(); ++i)
        EXPECT_GE(shown[i], static_cast<double>(i) / 20);
}

TEST(Run, DoesNotWaitForADistantFrameOfAPacedFilmOnCtrlC) {
    CountingRun run({.source = "frames: 10", .more = "paced: true\n"});
    run.start({"run.yaml", "--set", "source.fps=0.001"});
    ASSERT_TRUE(run.wait_for_lines(1)) << run.output();
    send_signal(run.pid(), SIGINT);
    EXPECT_EQ(run.wait(), 130) << run.output();
}

TEST(Run, OmitsImplausibleDeviceTimes) {
    for (const char *ns : {"0", "-1", "9223372036854775807"}) {
        CountingRun run({.source = "frames: 5", .raytracer = std::string("device_time_ns: ") + ns});
        ASSERT_EQ(run.run(), 0) << run.output();
        EXPECT_EQ(run.stats()["stages"]["raytracer"]["count"], 5);
        EXPECT_FALSE(run.stats()["stages"].contains("device")) << ns;
    }
}

TEST(Run, StopsAfterTheRequestedFrames) {
    CountingRun run({.source = "frames: 300"});
    ASSERT_EQ(run.run({"--config", "run.yaml", "--frames", "7"}), 0) << run.output();
    expect_every_frame_augmented(run, 7);
}

TEST(Run, SetOverridesValues) {
    CountingRun run({.source = "frames: 300"});
    ASSERT_EQ(
        run.run({"--config", "run.yaml", "--set", "source.options.frames=4", "--set", "outputs[0].path=other.txt"}),
        0)
        << run.output();
    EXPECT_TRUE(run.exists("other.txt"));
    EXPECT_FALSE(run.exists("counted.txt"));
}

TEST(Run, ReadsASceneFromDevShm) {
    const std::filesystem::path scene = "/dev/shm/arhost-run-test-" + std::to_string(::getpid()) + ".yaml";
    std::ofstream(scene) << small_scene;
    ArhostRun run(counting({.source = "frames: 3"}));
    const int status = run.run({"--config", "run.yaml", "--set", "raytracer.scene=" + scene.string()});
    std::filesystem::remove(scene);
    EXPECT_EQ(status, 0) << run.output();
}

TEST(Run, ShowsPlainVideoWhileNoMarkerIsVisible) {
    ArhostRun run(counting({.source = "frames: 30", .tracker = "lost_from: 10, lost_to: 20"}));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_THAT(expect_all_frames(run, 30), testing::ElementsAre(10, 11, 12, 13, 14, 15, 16, 17, 18, 19));
}

TEST(Run, HoldsTheLastPoseForHoldFrames) {
    CountingRun run({.source = "frames: 30", .tracker = "lost_from: 10, lost_to: 20"});
    ASSERT_EQ(run.run({"--config", "run.yaml", "--set", "tracker.hold_frames=4"}), 0) << run.output();
    const auto lines = counted(run);
    ASSERT_EQ(lines.size(), 30u);
    EXPECT_EQ(lines[13].overlay, "9"); // the pose of frame 9 is held
    EXPECT_EQ(lines[13].kind, 2);
    EXPECT_EQ(lines[14].overlay, "none");
}

TEST(Run, WorksWithoutTrackerAndRayTracer) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 5}}\n"
                  "outputs: [{plugin: sink_counter, path: counted.txt}]\n");
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_EQ(counted(run).size(), 5u);
}

TEST(Run, RefusesAnOutputThatAnotherRunWrites) {
    const auto writing = [](const std::string &path, int frames) {
        return "version: 1\nsource: {plugin: source_counter, options: {frames: " + std::to_string(frames) +
               ", delay_ms: 5}}\noutputs: [{plugin: sink_counter, path: " + path + "}]\n";
    };
    ArhostRun first(writing("counted.txt", 1000000));
    std::filesystem::create_directory_symlink(".", first.path("link"));
    first.start();
    ASSERT_TRUE(first.wait_for_lines(5)) << first.output();
    ArhostRun second(writing(first.path("link/counted.txt").string(), 5));
    second.expect(2, {"run.yaml:3:",
                      "outputs[0].path: '" + first.path("counted.txt").string() +
                          "' is being written by another run (process " + std::to_string(first.pid()) + ", ",
                      "run.yaml); end that run, or choose another path"});
    const std::string file = first.path("counted.txt").string();
    second.expect({"run.yaml", "--set", "outputs.0.path=own.txt", "--set", "stats=" + file}, 2,
                  {"stats: '" + file + "' is being written by another run"});
    second.expect({"run.yaml", "--set", "outputs.0.path=" + file + "/part.txt"}, 2, // as in a session's folder
                  {"outputs[0].path: '" + file + "' is being written by another run"});
    const auto lines = first.lines();
    EXPECT_TRUE(first.wait_for_lines(lines + 5)) << "the first run continues";
    send_signal(first.pid(), SIGKILL);
    first.wait();
    EXPECT_EQ(second.run(), 0) << "a killed run holds no lock: " << second.output();
    EXPECT_EQ(second.run(), 0) << "nor does a run that has ended: " << second.output();
}

TEST(Run, FeedsSeveralOutputs) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 50}}\n"
                  "outputs:\n- {plugin: sink_counter, path: counted.txt}\n- {plugin: sink_counter, path: second.txt, "
                  "options: {delay_ms: 1}}\n");
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_EQ(counted(run).size(), 50u);
    EXPECT_EQ(run.read("counted.txt"), run.read("second.txt"));
}

TEST(Run, AStoppedWindowDropsFramesButAFileGetsAll) {
    ArhostRun run(
        "version: 1\nsource: {plugin: source_counter, options: {frames: 1000000}}\n"
        "outputs:\n- {plugin: sink_realtime, path: window.txt, deadline_ms: 600000, options: {delay_ms: 1}}\n"
        "- {plugin: sink_counter, path: counted.txt, options: {delay_ms: 2}}\nstats: stats.json\n");
    run.start();
    ASSERT_TRUE(run.wait_for_lines(5, "window.txt")) << run.output();
    const pid_t window = run.worker("sink_realtime");
    send_signal(window, SIGSTOP);
    EXPECT_TRUE(run.wait_for_lines(run.lines() + 100)) << "the run waits for a window";
    send_signal(window, SIGCONT);
    send_signal(run.pid(), SIGINT);
    ASSERT_EQ(run.wait(), 130) << run.output();
    const auto stats = run.stats();
    const std::uint64_t composited = stats["frames"]["composited"];
    expect_all_frames(run, composited);
    const std::uint64_t dropped = stats["frames"]["dropped"]["sink_realtime"];
    EXPECT_GT(dropped, 0u);
    EXPECT_EQ(run.lines("window.txt") + dropped, composited);
}

TEST(Run, FinishesItsFilesOnCtrlCAndExitsWith130) {
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
        CountingRun run({.source = "frames: 100000", .raytracer = "delay_ms: 1"});
        run.start();
        ASSERT_TRUE(run.wait_for_lines(20)) << run.output();
        send_signal(run.pid(), signal);
        ASSERT_EQ(run.wait(), 130) << run.output();
        expect_every_frame_augmented(run, run.lines());
        EXPECT_EQ(run.stats()["frames"]["composited"], run.lines());
    }
}

TEST(Run, TreatsSimultaneousSignalsAsOne) { // timeout(1) signals the process and also its group
    CountingRun run({.source = "frames: 100000", .raytracer = "delay_ms: 1"});
    run.start();
    ASSERT_TRUE(run.wait_for_lines(20)) << run.output();
    send_signal(run.pid(), SIGSTOP); // so that it receives both signals at the same time
    for (const int signal : {SIGTERM, SIGINT, SIGHUP, SIGCONT})
        send_signal(run.pid(), signal);
    ASSERT_EQ(run.wait(), 130) << run.output();
    EXPECT_TRUE(run.exists("counted.txt.done"));
    expect_every_frame_augmented(run, run.lines());
}

// The output would hang for an hour.
TEST(Run, ALaterSecondCtrlCEndsTheRunAtOnce) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 100000, delay_ms: 1}}\n"
                  "outputs: [{plugin: sink_counter, path: counted.txt, stop_deadline_ms: 3600000, "
                  "options: {hang_in_stop: true}}]\n");
    run.start();
    ASSERT_TRUE(run.wait_for_lines(20)) << run.output();
    send_signal(run.pid(), SIGINT);
    EXPECT_TRUE(run.running());
    EXPECT_TRUE(run.wait_for_output("files are finished; a second signal ends the run at once")) << run.output();
    ASSERT_TRUE(run.running()) << "the run must wait for the output";
    EXPECT_FALSE(run.exists("counted.txt.done"));
    EXPECT_TRUE(eventually([&] { // ignored in the first second
        send_signal(run.pid(), SIGINT);
        return !run.running();
    }));
    EXPECT_EQ(run.wait(), 130) << run.output();
}

TEST(Run, WorksWithoutStandardStreams) {
    struct {
        const char *name;
        void (*prepare)();
    } const cases[] = {{"closed",
                        [] {
                            for (int fd : {0, 1, 2})
                                ::close(fd);
                        }},
                       {"an unread pipe", [] {
                            int ends[2];
                            if (::pipe(ends) != 0)
                                ::_exit(126);
                            ::dup2(ends[1], STDOUT_FILENO);
                            ::dup2(ends[1], STDERR_FILENO);
                            ::close(ends[0]);
                            ::close(ends[1]);
                            ::signal(SIGPIPE, SIG_DFL);
                        }}};
    for (const auto &c : cases) {
        CountingRun run(
            {.source = "frames: 60, crash_at: 30", .tracker = "crash_at: 20", .raytracer = "error_at: 10"});
        // The source crashes at frame 30 after every restart; the log also contains these crashes.
        run.start({"--config", "run.yaml", "-v", "--set", "restart.first_delay_ms=1"}, c.prepare);
        EXPECT_EQ(run.wait(), 1) << c.name;
        EXPECT_THAT(expect_all_frames(run, 30), testing::ElementsAre(10, 20)) << c.name;
        EXPECT_EQ(run.stats()["frames"]["composited"], 30) << c.name;
    }
}

TEST(Run, WorksIfTheParentIgnoresSigchld) {
    CountingRun run({.source = "frames: 5"});
    run.start({"--config", "run.yaml"}, [] { ::signal(SIGCHLD, SIG_IGN); });
    EXPECT_EQ(run.wait(), 0) << run.output();
}

TEST(Run, KeepsAForeignTemporaryFileNextToTheStatistics) {
    CountingRun run({.source = "frames: 5"});
    run.write("stats.json.tmp", "foreign");
    EXPECT_EQ(run.run(), 0) << run.output();
    EXPECT_EQ(run.read("stats.json.tmp"), "foreign");
    EXPECT_EQ(run.stats()["frames"]["in"], 5);
}

TEST(Run, WritesStatisticsToDevices) {
    for (const char *file : {"/dev/null", "/dev/full"}) {
        ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 5}}\n"
                      "outputs: [{plugin: sink_counter, path: counted.txt}]\nstats: " +
                      std::string(file) + "\n");
        const bool works = std::string(file) == "/dev/null";
        EXPECT_EQ(run.run(), works ? 0 : 1) << run.output();
        EXPECT_EQ(counted(run).size(), 5u);
        if (!works) {
            EXPECT_THAT(run.output(), HasSubstr("stats: cannot write "));
        }
    }
    EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
}

TEST(Run, LeavesNoProcessIfKilled) {
    CountingRun run({.source = "frames: 100000", .raytracer = "delay_ms: 1"});
    run.start();
    ASSERT_TRUE(run.wait_for_lines(5)) << run.output();
    const std::vector<pid_t> workers = run.workers();
    ASSERT_EQ(workers.size(), 4u);
    ::kill(run.pid(), SIGKILL);
    EXPECT_EQ(run.wait(), 128 + SIGKILL);
    EXPECT_TRUE(eventually([&] { return std::ranges::none_of(workers, is_alive); })) << "a worker outlived its host";
}

TEST(Run, ContinuesWhileTheTerminalIsStopped) {
    CountingRun run({.source = "frames: 200"});
    run.start({"--config", "run.yaml", "-v"}, [] { // stderr is a full pipe that nobody reads
        int ends[2];
        if (::pipe2(ends, O_NONBLOCK) != 0)
            ::_exit(126);
        const char bytes[4096] = {};
        while (::write(ends[1], bytes, sizeof bytes) > 0) {
        }
        ::fcntl(ends[1], F_SETFL, 0);
        ::dup2(ends[1], STDERR_FILENO);
    });
    EXPECT_TRUE(run.eventually([&] { return run.exists("stats.json"); }));
    EXPECT_TRUE(run.exists("counted.txt.done"));
    expect_every_frame_augmented(run, 200);
    EXPECT_TRUE(eventually([&] { // it is blocked while writing its last lines; a signal must end it
        ::kill(run.pid(), SIGTERM);
        return !run.running();
    }));
}

TEST(Run, PrintsProgressAsPlainLinesWithoutATerminal) {
    CountingRun run({.source = "frames: 5"});
    ASSERT_EQ(run.run(), 0);
    EXPECT_THAT(run.output(), HasSubstr("frame 5/5"));
    EXPECT_THAT(run.output(), testing::Not(HasSubstr("\033")));
}

TEST(Run, RedrawsProgressOnATerminal) {
    CountingRun run({.source = "frames: 60, delay_ms: 10"});
    const int terminal = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    ASSERT_GE(terminal, 0);
    ASSERT_EQ(::grantpt(terminal), 0);
    ASSERT_EQ(::unlockpt(terminal), 0);
    const std::string name = ::ptsname(terminal);
    const int kept_open = ::open(
        name.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC); // otherwise a read before arhost opens the terminal may fail
    run.start({"--config", "run.yaml", "--set", "outputs[0].path=out/counted.txt"}, // avoids a warning
              [&] { ::dup2(::open(name.c_str(), O_RDWR | O_NOCTTY), STDERR_FILENO); });
    ::fcntl(terminal, F_SETFL, O_NONBLOCK);
    std::string shown;
    EXPECT_TRUE(eventually([&] {
        const bool ended = !run.running(); // reads once more after arhost has exited
        char bytes[4096];
        for (ssize_t count; (count = ::read(terminal, bytes, sizeof bytes)) > 0;)
            shown.append(bytes, static_cast<std::size_t>(count));
        return ended;
    }));
    ::close(kept_open);
    ::close(terminal);
    EXPECT_EQ(run.wait(), 0);
    EXPECT_THAT(shown, HasSubstr("\r\033[Kframe ")); // the line must overwrite the previous one
    EXPECT_THAT(shown, testing::ContainsRegex("frame 60/60  [0-9.]+ fps  finishing the outputs  ms p50/p95/p99:  "
                                              "latency [0-9./]+  to sink_counter [0-9./]+  source [0-9./]+  "
                                              "tracker [0-9./]+  raytracer [0-9./]+  composite [0-9./]+"));
    const std::size_t summary = shown.rfind("\r\033[K") + 4; // of the counters
    EXPECT_EQ(shown.find("frame ", summary), std::string::npos) << "the line must be cleared";
    EXPECT_GE(shown.find('\n'), summary) << shown;
}

TEST(CommandLine, PrintsVersionHelpAndPlugins) {
    ArhostRun run;
    run.expect({"--version"}, 0, {"arhost 0."});
    run.expect({"--help"}, 0, {"--config"});
    EXPECT_EQ(run.run({"plugins", "--options"}), 1) << "some test plugins are broken";
    EXPECT_THAT(run.output(), HasSubstr("rt_counter"));
    EXPECT_THAT(run.output(), HasSubstr("delay_ms"));
    EXPECT_THAT(run.output(), HasSubstr("broken_version     cannot be used: "));
    EXPECT_THAT(run.output(), HasSubstr("no_plugin          cannot be used: "));
    EXPECT_THAT(run.output(), HasSubstr("while its library was loaded"));
    EXPECT_THAT(run.output(), HasSubstr("first                The first of three (default '1')"));
    EXPECT_THAT(run.output(), HasSubstr("Attempts attacks,  [2Jfor tests."));
    EXPECT_THAT(run.output(), HasSubstr("third                The third of three (default 'c')"));
    EXPECT_EQ(run.run({"plugins", "--options", "rt_counter"}), 0) << run.output();
    EXPECT_THAT(run.output(), AllOf(HasSubstr("delay_ms"), Not(HasSubstr("tracker"))));
    EXPECT_EQ(run.run({"plugins", arhost::test::test_plugin_directory() + "/rt_counter.so"}), 0) << run.output();
    run.expect({"plugins", "rt_counted"}, 2, {"there is no plugin 'rt_counted'"});
    EXPECT_EQ(run.run({}), 2);
    EXPECT_EQ(run.run({"--nonsense"}), 2);
}

TEST(CommandLine, TakesTheConfigurationAsArgument) {
    CountingRun run({.source = "frames: 3"});
    EXPECT_EQ(run.run({"run.yaml"}), 0) << run.output();
    EXPECT_EQ(counted(run).size(), 3u);
    EXPECT_EQ(run.run({"--frames", "2", "run.yaml"}), 0) << run.output();
    EXPECT_EQ(counted(run).size(), 2u);
    run.expect({"run.yaml", "other.yaml"}, 2, {"not expected: other.yaml"});
}

TEST(CommandLine, SuggestsACommandForAMisspeltOne) {
    CountingRun run({.source = "frames: 3"});
    for (const std::vector<std::string> &arguments : {std::vector<std::string>{"chek", "run.yaml"}, {"chek"}}) {
        EXPECT_EQ(run.run(arguments), 2);
        EXPECT_EQ(run.output(), "error: there is no command or file 'chek'; did you mean 'check'?\n");
    }
    std::filesystem::rename(run.path("run.yaml"), run.path("chek"));
    EXPECT_EQ(run.run({"chek"}), 0) << run.output();
}

TEST(CommandLine, HelpDescribesCommands) {
    ArhostRun run;
    run.expect({"-V"}, 0, {"arhost 0."});
    run.expect({"help"}, 0, {"Usage: arhost [OPTIONS] [FILE] [SUBCOMMAND]"});
    const std::string help = run.output();
    EXPECT_EQ(run.run({"--help"}), 0);
    EXPECT_EQ(run.output(), help);
    for (const char *line : {"\n  FILE  ", "\n  --frames N  ", "\n  --set KEY=VALUE ...  "})
        EXPECT_THAT(help, HasSubstr(line));
    EXPECT_EQ(run.run({"help", "new-plugin"}), 0);
    for (const char *line : {"\n  KIND raytracer|tracker|source|sink (required)\n", "\n  NAME (required)  ",
                             "\n  --language c|cpp|rust|python (required)\n"})
        EXPECT_THAT(run.output(), HasSubstr(line));
    run.expect({"help", "check"}, 0, {"Usage: arhost check [OPTIONS] FILE"});
    run.expect({"help", "devices"}, 0, {"Usage: arhost devices [OPTIONS] [PLUGIN...]"});
    EXPECT_EQ(run.run({"plugins", "--devices"}), 2) << "replaced with 'arhost devices'";
    run.expect({"help", "conform"}, 0, {"Usage: arhost conform [OPTIONS] [PLUGIN]"});
    run.expect({"help", "map"}, 0, {"Usage: arhost map [OPTIONS]"});
    run.expect({"help", "marker"}, 0, {"Usage: arhost marker [OPTIONS] MARKERS"});
    run.expect({"help", "calibrate"}, 0, {"Usage: arhost calibrate [OPTIONS]"});
    run.expect({"help", "help"}, 0, {"Usage: arhost help [OPTIONS] [COMMAND]"});
    EXPECT_EQ(run.run({"help", "nonsense"}), 2);
}

// Runs a shell with the arguments in a scratch folder, where `script` is the variable SCRIPT. Returns its exit
// status, 127 if it is not installed; its output is in output.txt.
int run_shell(const ArhostRun &run, const std::string &shell, const std::string &script = "") {
    ::setenv("SCRIPT", script.c_str(), 1);
    const std::string command = "cd '" + run.path("").string() +
                                "' && HOME=$PWD XDG_CONFIG_HOME=$PWD XDG_DATA_HOME=$PWD " + shell +
                                " >output.txt 2>&1";
    return WEXITSTATUS(std::system(command.c_str()));
}

TEST(CommandLine, CompletesInBash) {
    ArhostRun run;
    run.write("lab.yaml", "");
    run.write("plugins/x.so", "");
    const auto completed = [&](const std::string &words) {
        EXPECT_EQ(
            run_shell(run, "bash -c \"$SCRIPT\"",
                      "source '" + arhost::test::build_directory() + "/pages/arhost.bash'; COMP_WORDS=(" + words +
                          "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _arhost; printf '%s ' \"${COMPREPLY[@]}\""),
            0);
        return run.output();
    };
    EXPECT_EQ(completed("arhost ch"), "check ");
    EXPECT_EQ(completed("arhost lab"), "lab.yaml ");
    EXPECT_EQ(completed("arhost plug"), "plugins ") << "the command, not the folder";
    EXPECT_EQ(completed("arhost --config la"), "lab.yaml ");
    EXPECT_EQ(completed("arhost --set la"), " ");
    EXPECT_EQ(completed("arhost --allow"), "--allow-no-target ");
    EXPECT_EQ(completed("arhost check la"), "lab.yaml ");
    EXPECT_EQ(completed("arhost check --no"), "--no-open ");
    EXPECT_EQ(completed("arhost new-plugin ra"), "raytracer ");
    EXPECT_EQ(completed("arhost new-plugin raytracer x --language py"), "python ");
    EXPECT_EQ(completed("arhost dev"), "devices ");
    EXPECT_EQ(completed("arhost devices --js"), "--json ");
    EXPECT_EQ(completed("arhost plugins --dev"), " ");
    EXPECT_EQ(completed("arhost help rep"), "replay ");
    EXPECT_EQ(completed("arhost conform --timeo"), "--timeout-factor ");
    EXPECT_EQ(completed("arhost conform plugins/"), "plugins/x.so ");
    EXPECT_EQ(completed("arhost conform --reads pl"), "plugins ");
    EXPECT_EQ(completed("arhost marker --cha"), "--charuco ");
    EXPECT_EQ(completed("arhost marker --map la"), "lab.yaml ");
    EXPECT_EQ(completed("arhost calibrate --chess"), "--chessboard ");
    EXPECT_EQ(completed("arhost calibrate --images la"), "lab.yaml ");
}

TEST(CommandLine, CompletesInFish) {
    ArhostRun run;
    if (run_shell(run, "fish --version") != 0)
        GTEST_SKIP() << "fish is not installed";
    run.write("lab.yaml", "");
    const auto completed = [&](const std::string &words) {
        EXPECT_EQ(run_shell(run, "fish -c \"$SCRIPT\"",
                            "source '" + arhost::test::build_directory() + "/pages/arhost.fish'; complete -C '" +
                                words + "'"),
                  0);
        return run.output();
    };
    EXPECT_EQ(completed("arhost ch"), "check\tCheck a configuration: open everything that a run opens\n");
    EXPECT_EQ(completed("arhost lab"), "lab.yaml\n");
    EXPECT_EQ(completed("arhost --config la"), "lab.yaml\n");
    EXPECT_THAT(completed("arhost --allow"), testing::StartsWith("--allow-no-target\tExit with status 0 even if"));
    EXPECT_EQ(completed("arhost check la"), "lab.yaml\n");
    EXPECT_EQ(completed("arhost new-plugin ra"), "raytracer\n");
    EXPECT_EQ(completed("arhost new-plugin raytracer x --language py"), "python\tProgramming language\n");
    EXPECT_EQ(completed("arhost help rep"), "replay\n");
    EXPECT_EQ(completed("arhost conform --timeo"),
              "--timeout-factor\tMultiply each deadline, for slow machines (1)\n");
}

TEST(CommandLine, CompletesInZsh) {
    ArhostRun run;
    if (run_shell(run, "zsh --version") != 0)
        GTEST_SKIP() << "zsh is not installed";
    run.write("folder/lab.yaml", "");
    run.write("functions/_arhost", read_file(arhost::test::build_directory() + "/pages/arhost.zsh"));
    // Types `words` and a tab on a pseudo-terminal, and waits until zsh adds `rest`.
    const auto completes = [&](const std::string &words, const std::string &rest) {
        return run_shell(run, "timeout 20 zsh -f -c \"$SCRIPT\"",
                         "zmodload zsh/zpty\nzpty shell TERM=dumb zsh -f -i\n"
                         "zpty -w shell 'cd folder; fpath=(../functions $fpath); autoload -Uz compinit; compinit -u; "
                         "echo $((6 * 7))'\nzpty -r -m shell output '*42*'\nzpty -w -n shell '" +
                             words + "'$'\\t'\nzpty -r -m shell output '*" + rest + "*'") == 0;
    };
    EXPECT_TRUE(completes("arhost ch", "eck "));
    EXPECT_TRUE(completes("arhost lab", ".yaml "));
    EXPECT_TRUE(completes("arhost --config ", "lab.yaml "));
    EXPECT_TRUE(completes("arhost --allow", "-no-target "));
    EXPECT_TRUE(completes("arhost check ", "lab.yaml "));
    EXPECT_TRUE(completes("arhost new-plugin ra", "ytracer "));
    EXPECT_TRUE(completes("arhost new-plugin raytracer x --language py", "thon "));
    EXPECT_TRUE(completes("arhost help rep", "lay "));
    EXPECT_TRUE(completes("arhost conform --timeo", "ut-factor "));
    EXPECT_TRUE(completes("arhost marker --cha", "ruco "));
    EXPECT_TRUE(completes("arhost calibrate --chess", "board "));
    EXPECT_TRUE(completes("arhost map --skip", "-unconnected "));
}

TEST(CommandLine, HasAManPageForEachProgram) {
    const std::filesystem::path pages = arhost::test::build_directory() + "/pages";
    for (const char *program :
         {"arhost", "arhost-calibrate", "arhost-conform", "arhost-ctl", "arhost-devices", "arhost-inprocess",
          "arhost-launcher", "arhost-map", "arhost-marker", "arhost-new-plugin", "arhost-plugins", "arhost-schema",
          "arhost-view", "arhost-worker"})
        EXPECT_TRUE(std::filesystem::is_regular_file(pages / (std::string(program) + ".1.gz"))) << program;
    ArhostRun run;
    EXPECT_EQ(run_shell(run, "zcat '" + (pages / "arhost.1.gz").string() + "'"), 0);
    for (const char *part :
         {"\n.SH SYNOPSIS\n\\fBarhost\\fR [\\fIOPTIONS\\fR] [\\fIFILE\\fR]\n", "\n.SS arhost check\n",
          "\\fB\\-\\-no\\-open\\fR\n", "one of: run, replay, latency, check", "See arhost\\-new\\-plugin(1)."})
        EXPECT_THAT(run.read("output.txt"), HasSubstr(part));
}

TEST(CommandLine, ChecksAConfigurationWithoutRunningIt) {
    CountingRun run({.source = "frames: 5"});
    run.expect({"check", "run.yaml"}, 0,
               {"source: source_counter: 64 x 48 px, 30 fps, 5 frames\n"
                "camera: fx 64 px, fy 64 px, cx 31.5 px, cy 23.5 px\n"
                "tracker: tracker_counter: 'tag36h11-3' (tag36h11 3)\n"
                "raytracer: rt_counter: ",
                "\noutput: sink_counter: " + run.path("counted.txt").string() + "\nrun.yaml: OK"});
    EXPECT_FALSE(run.exists("counted.txt"));
}

TEST(CommandLine, CheckFindsWhatWouldStopTheRun) {
    const auto finds = [](const std::string &sources, const std::string &outputs, const std::string &more = "") {
        ArhostRun run("version: 1\nsource: {" + sources + "}\noutputs:\n" + outputs + more);
        run.write("film.mp4", "old");
        EXPECT_EQ(run.run({"check", "run.yaml"}), 2) << run.output();
        EXPECT_FALSE(run.exists("out")) << "check created a folder";
        EXPECT_EQ(run.read("film.mp4"), "old");
        EXPECT_EQ(run.output().find("arhost-check-"), std::string::npos) << run.output();
        const std::string messages = run.messages();
        EXPECT_EQ(std::ranges::count(messages, '\n'), 1) << "the error is printed once\n" << messages;
        return messages;
    };
    const std::string counter = "plugin: source_counter, options: {frames: 5}";
    const std::string film = "- {plugin: sink_video, path: film.mp4}\n";
    EXPECT_THAT(finds("plugin: source_file, path: flim.mp4", film),
                HasSubstr("error: run.yaml:2:37: source.path: there is no file '"));
    EXPECT_THAT(finds("plugin: source_file, path: film.mp4", "- {plugin: sink_video, path: other.mp4}\n"),
                HasSubstr("film.mp4' cannot be read: "));
    EXPECT_THAT(
        finds(counter, film + "- {plugin: sink_video, path: out/film.avi}\n"),
        testing::ContainsRegex("error: run.yaml:5:3: sink_video#1: path: '.*/out/film.avi' must end in .mp4"));
    EXPECT_THAT(finds(counter, film + "- {plugin: sink_poses, path: film.mp4/a.jsonl}\n"),
                HasSubstr("run.yaml:5:30: outputs[1].path: '"));
    EXPECT_THAT(finds(counter, film,
                      "camera: {width: 640, height: 480, fx: 600}\ntracker: {plugin: tracker_counter, "
                      "targets: [{marker: 3, family: tag36h11, side_mm: 80}]}\n"),
                HasSubstr("run.yaml:5:9: camera: "));
    EXPECT_THAT(
        finds(counter, "- {plugin: sink_images, path: f-%d.png}\n- {plugin: sink_poses, path: f-1.png}\n"),
        HasSubstr("run.yaml:5:30: outputs[1].path: another output, 'f-%d.png', can write a file of the same"));
}

TEST(Run, WarnsOfTargetsThatWereNeverSeen) {
    ArhostRun run("version: 1\nsource: {plugin: source_synthetic, options: {frames: 10, id: 4, side_mm: 80}}\n"
                  "tracker: {plugin: tracker_aruco, targets: [{ids: [7, 4, 5], family: tag36h11, side_mm: 80}]}\n"
                  "outputs: [{plugin: sink_null}]\n");
    run.expect(0, {"tracker: never seen in 10 frames: 'tag36h11-7' (tag36h11 7), 'tag36h11-5' (tag36h11 5)\n"});
}

TEST(Run, ReportsAMarkerOfASmallFamilyWhenItIsSeenAgain) {
    const auto output_of = [](int frames, const std::string &option) {
        ArhostRun run("version: 1\nsource: {plugin: source_synthetic, options: {frames: " + std::to_string(frames) +
                      ", family: DICT_4X4_50, id: 4, side_mm: 80}}\ntracker: {plugin: tracker_aruco, " + option +
                      "targets: [{name: cup, marker: 4, dictionary: DICT_4X4_50, side_mm: 80}]}\n"
                      "outputs: [{plugin: sink_null}]\n");
        run.run();
        return run.output();
    };
    EXPECT_THAT(output_of(1, ""),
                HasSubstr("no target was seen in 1 frame; it looked for 'cup' (DICT_4X4_50 4); it saw "
                          "DICT_4X4_50 4 (1 frame) but got no pose: "));
    EXPECT_THAT(output_of(1, "confirm: false, "), Not(HasSubstr("no target")));
    EXPECT_THAT(output_of(2, ""), Not(HasSubstr("no target")));
}

TEST(Run, TellsWhetherTheTrackerHasFoundQuadrilaterals) {
    // Pictures of a dark square, and without one.
    const auto output_of = [](const std::string &tracker, const std::string &family, int square_px) {
        ArhostRun run("version: 1\nsource: {plugin: source_file, path: picture.pgm}\n"
                      "camera: {width: 320, height: 240, fx: 300, fy: 300, cx: 159.5, cy: 119.5}\n"
                      "tracker: {plugin: " +
                      tracker + ", targets: [{marker: 7, family: " + family +
                      ", side_mm: 80}]}\noutputs: [{plugin: sink_null}]\n");
        std::string picture = "P5 320 240 255\n";
        for (int y = 0; y < 240; ++y)
            for (int x = 0; x < 320; ++x)
                picture += std::max(std::abs(x - 160), std::abs(y - 120)) < square_px / 2 ? '\x20' : '\x7f';
        run.write("picture.pgm", picture);
        EXPECT_EQ(run.run(), 1);
        return run.output();
    };
    for (const auto &[tracker, family] : {std::pair{"tracker_apriltag", "tag25h9"},
                                          {"tracker_aruco", "tag25h9"},
                                          {"tracker_pattern", "artoolkit-4x4"}}) {
        EXPECT_THAT(output_of(tracker, family, 80),
                    HasSubstr(" quadrilaterals per frame, none could be read as a marker of these targets; compare"))
            << tracker;
        EXPECT_THAT(output_of(tracker, family, 0), HasSubstr("it found no quadrilaterals: check the light"))
            << tracker;
    }
}

namespace {

// A run in mode live whose tracker looks for other targets than those in view. It is interrupted 20 frames after it
// has logged `text`.
std::string output_of_a_live_run(int fps, const std::string &in_view, const std::string &targets,
                                 const std::string &text) {
    ArhostRun run("version: 1\nmode: live\nsource: {plugin: source_synthetic, fps: " + std::to_string(fps) +
                  ", options: {frames: 0, " + in_view + "}}\ntracker: {plugin: tracker_aruco, targets: [{" + targets +
                  ", family: tag36h11, side_mm: 80}]}\noutputs: [{plugin: sink_counter, path: out/counted.txt}]\n");
    run.start();
    EXPECT_TRUE(run.wait_for_output(text)) << run.output();
    EXPECT_TRUE(run.wait_for_lines(run.lines("out/counted.txt") + 20, "out/counted.txt")) << run.output();
    send_signal(run.pid(), SIGINT);
    EXPECT_EQ(run.wait(), 130) << run.output();
    return run.output();
}

} // namespace

TEST(Run, InModeLiveWarnsOnceAfterFiveSecondsWithoutTargets) {
    const std::string warning = "has seen no target yet; it looks for 'tag36h11-7' (tag36h11 7); it saw tag36h11 4 (";
    const std::string output = output_of_a_live_run(10, "id: 4, side_mm: 80", "marker: 7", warning);
    EXPECT_EQ(output.find(warning), output.rfind(warning)) << output;
}

TEST(Run, InModeLiveNamesOtherMarkersThatAreFoundAfterTheWarning) {
    const std::string hint = "other markers were in view: DICT_5X5_50 4";
    const std::string output = output_of_a_live_run(5, "width: 640, height: 480, family: DICT_5X5_50, id: 4",
                                                    "marker: 7", "info: tracker: " + hint);
    EXPECT_THAT(output, testing::ContainsRegex(
                            "warning: tracker: has seen no target yet;.*\n(.*\n)*.*info: tracker: " + hint + "\n"));
    EXPECT_THAT(output, HasSubstr("it looked for 'tag36h11-7' (tag36h11 7); " + hint));
}

TEST(Run, InModeLiveWarnsAfterFiveSecondsOfTargetsThatWereNotSeen) {
    const std::string output = output_of_a_live_run(10, "id: 4, side_mm: 80", "ids: 4-5", "never seen in ");
    // A slow tracker skips frames, so their numbers vary.
    const std::string warning = "never seen in [0-9]+ frames: 'tag36h11-5' \\(tag36h11 5\\)\n";
    EXPECT_THAT(output, testing::ContainsRegex(warning + "(.*\n)*.*" + warning)) << "after 5 s and at the end";
}

TEST(CommandLine, CheckRunsTheFirstFramesOnRequest) {
    const auto yaml = [](const std::string &ids) {
        return "version: 1\nsource: {plugin: source_synthetic, options: {frames: 0, id: 4, side_mm: 80}}\n"
               "tracker: {plugin: tracker_aruco, targets: [{ids: " +
               ids + ", family: tag36h11, side_mm: 80}]}\noutputs: [{plugin: sink_poses, path: poses.jsonl}]\n";
    };
    ArhostRun run(yaml("4-5"));
    run.expect({"check", "--run", "10", "run.yaml"}, 0,
               {"\n10 frames: 10 with a target, 0 with an overlay\ntarget tag36h11-4: in 10 frames, ",
                "\ntarget tag36h11-5: not seen\nms p50/p95/p99:  latency ", "\nrun.yaml: OK"});
    EXPECT_FALSE(run.exists("poses.jsonl"));

    ArhostRun wrong_id(yaml("5"));
    wrong_id.expect({"check", "--run", "10", "run.yaml"}, 1, {"no target was seen in 10 frames"});
    EXPECT_THAT(wrong_id.output(), testing::Not(HasSubstr("run.yaml: OK")));

    run.expect({"check", "--run", "10", "--no-open", "run.yaml"}, 2, {"--run and --no-open exclude each other"});
}

TEST(CommandLine, CheckKeepsItsReportApartFromAnOutputToStandardOutput) {
    ArhostRun run("version: 1\nsource: {plugin: source_synthetic, options: {frames: 0}}\n"
                  "outputs: [{plugin: sink_poses, path: \"-\"}]\n");
    run.start({"check", "--run", "2", "run.yaml"},
              [] { ::dup2(::open("poses.jsonl", O_CREAT | O_WRONLY, 0644), STDOUT_FILENO); });
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("\nrun.yaml: OK\n"));
    EXPECT_EQ(run.lines("poses.jsonl"), 2u) << run.read("poses.jsonl");
}

TEST(CommandLine, CheckReadsWhatAnOutputWritesToAFifo) {
    ArhostRun run("version: 1\nsource: {plugin: source_synthetic, options: {frames: 0}}\n"
                  "outputs: [{plugin: sink_poses, path: poses.fifo}]\n");
    ASSERT_EQ(::mkfifo(run.path("poses.fifo").c_str(), 0600), 0);
    EXPECT_EQ(run.run({"check", "--run", "2", "run.yaml"}), 0) << run.output();
}

TEST(CommandLine, CheckOpensNothingOnRequest) {
    ArhostRun run("version: 1\nsource: {plugin: source_v4l2, allow: [video], options: {device: /dev/video-none}}\n");
    run.expect({"check", "run.yaml"}, 2, {"/dev/video-none"});
    EXPECT_EQ(run.run({"check", "--no-open", "run.yaml"}), 0) << run.output();
}

TEST(Run, FailsIfTheTrackerSeesNoTarget) {
    CountingRun run({.source = "frames: 5", .tracker = "lost_to: 100"});
    const std::string message =
        "no target was seen in 5 frames, so no frame has an overlay; it looked for 'tag36h11-3' (tag36h11 3);";
    run.expect(1, {"error: tracker: " + message});
    EXPECT_EQ(counted(run).size(), 5u);
    run.expect({"run.yaml", "--allow-no-target"}, 0, {"warning: tracker: " + message});
}

TEST(Run, FailsIfTheTrackerFailsInEveryFrame) {
    ArhostRun run("version: 1\nsource: {plugin: source_synthetic, options: {width: 64, height: 48, frames: 5}}\n"
                  "tracker: {plugin: tracker_counter, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}\n"
                  "outputs: [{plugin: sink_counter, path: counted.txt}]\n");
    run.expect({"run.yaml", "--allow-no-target"}, 1,
               {"error: arhost: 5 frames have no overlay because the tracker failed", "warning: tracker: frame 0: "});
    EXPECT_THAT(run.output(), Not(HasSubstr("warning: tracker: frame 1: ")));
    EXPECT_THAT(run.output(), testing::ContainsRegex("warning: tracker: .* in 5 frames\n"));
    EXPECT_EQ(counted(run).size(), 5u);
}

TEST(Run, TakesAPercentSignLiterallyIfThePluginWritesOneFile) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 3}}\noutputs:\n"
                  "- {plugin: sink_poses, path: p-%d.jsonl}\n- {plugin: sink_poses, path: p-1.jsonl}\n");
    for (int i = 0; i < 2; ++i) { // the files exist in the second run
        EXPECT_EQ(run.run(), 0) << run.output();
        EXPECT_FALSE(run.read("p-%d.jsonl").empty());
        EXPECT_EQ(run.read("p-%d.jsonl"), run.read("p-1.jsonl"));
    }
}

// rt_counter declares no capability.
const std::string rich_scene = "version: 1\naxes: z-up\nmaterials: {m: {model: glass}}\nlights: [{type: sphere, "
                               "position: [0, 0, 90], radius: 5, intensity: 1}]\n"
                               "objects: [{sphere: {centre: [0, 0, 10], radius: 10}, material: m}]\n";
const std::string lacks =
    "rt_counter does not support parts of the scene: glass, area lights. The image will lack them";

TEST(Run, WarnsOfPartsOfTheSceneThatTheRayTracerLacks) {
    ArhostRun run(counting({.source = "frames: 5"}));
    run.write("scene.yaml", rich_scene);
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("warning: raytracer: " + lacks));
    expect_every_frame_augmented(run, 5);
    for (const std::vector<std::string> &check :
         {std::vector<std::string>{"check", "run.yaml"}, {"check", "--no-open", "run.yaml"}}) {
        run.expect(check, 0, {"warning: raytracer: " + lacks});
    }
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run(), 0);
    EXPECT_THAT(run.output(), Not(HasSubstr("does not support")));
}

TEST(Run, DistortsImagesOfARayTracerWithoutLensSupport) {
    // rt_counter receives a camera without lens distortion and fills the entire image.
    ArhostRun run(counting(
        {.source = "frames: 5",
         .more = "camera: {width: 64, height: 48, fx: 60, distortion: {model: brown, coefficients: [-0.2, 0.05, "
                 "0, 0]}}\n"}));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_THAT(run.output(),
                HasSubstr("rt_counter does not support lens distortion: its worker warps the rendered images"));
    expect_every_frame_augmented(run, 5);
}
