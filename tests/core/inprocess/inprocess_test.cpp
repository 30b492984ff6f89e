// SPDX-License-Identifier: Apache-2.0
//
// Tests that arhost-inprocess behaves like arhost, except for separate processes and deadlines.
#include "arhost_run.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>

using namespace arhost::test;
using testing::HasSubstr;

namespace {

// Runs `program` in the folder of `run`, after the shell commands `before`. Returns its exit status; its output is in
// output.txt.
int run_program(const ArhostRun &run, const std::string &program, const std::string &before = "FILE=run.yaml") {
    const std::string command = "cd " + run.path("").string() + " && (" + before +
                                "; ARHOST_PLUGIN_PATH=" + arhost::test::test_plugin_directory() + " timeout 60 " +
                                arhost::test::build_directory() + "/bin/" + program +
                                " --config \"$FILE\") >output.txt 2>&1";
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}
int run_in_process(const ArhostRun &run) {
    return run_program(run, "arhost-inprocess");
}

} // namespace

TEST(InProcess, WritesTheSameBytesAsSeparateProcesses) {
    CountingRun run({.source = "frames: 30", .tracker = "lost_from: 5, lost_to: 9", .raytracer = "error_at: 20"});
    ASSERT_EQ(run.run(), 1) << run.output(); // frame 20 has no overlay
    const std::string of_processes = run.read("counted.txt");
    std::filesystem::remove(run.path("counted.txt"));
    ASSERT_EQ(run_in_process(run), 1) << run.read("output.txt");
    EXPECT_EQ(run.read("counted.txt"), of_processes);
    EXPECT_EQ(counted(run).size(), 30u);
}

TEST(InProcess, IgnoresDeadlines) {
    CountingRun run(
        {.source = "frames: 2", .raytracer = "delay_ms: 300", .deadline = std::chrono::milliseconds(100)});
    EXPECT_EQ(run_in_process(run), 0) << run.read("output.txt");
    EXPECT_EQ(run.stats()["frames"]["augmented"], 2);
}

TEST(InProcess, ReportsAPluginThatRejectsItsOptions) {
    CountingRun run({.source = "frames: 2", .raytracer = "reject: true"});
    EXPECT_EQ(run_in_process(run), 2);
    EXPECT_THAT(run.read("output.txt"), HasSubstr("run.yaml:5:"));
    EXPECT_THAT(run.read("output.txt"), HasSubstr("rejected, as the option 'reject' requests"));
}

TEST(InProcess, ReportsErrorsLikeArhost) {
    ArhostRun run(
        "version: 1\nsource: {plugin: source_counter}\noutputs: [{plugin: sink_poses, path: poses.jsonl}]\n");
    for (const char *situation : {"FILE='two\nlines'", "FILE=$PWD/run.yaml; mkdir gone; cd gone; rmdir \"$PWD\""}) {
        EXPECT_EQ(run_program(run, "arhost", situation), 2);
        const std::string expected = run.output();
        EXPECT_EQ(std::ranges::count(expected, '\n'), 1) << expected;
        EXPECT_EQ(run_program(run, "arhost-inprocess", situation), 2);
        EXPECT_EQ(run.output(), expected);
    }
}

// A worker thread cannot be killed, but it ends by itself if the host closes the channel while it waits for a
// command.
TEST(InProcess, RestartsAPluginWhoseDeviceIsLost) {
    CountingRun run({.source = "frames: 30", .raytracer = "error_at: 20, error: -6"});
    ASSERT_EQ(run_in_process(run), 1) << run.read("output.txt");
    EXPECT_EQ(counted(run).size(), 30u);
    EXPECT_EQ(run.stats()["frames"]["augmented"], 29) << "the frame is retried once";
    EXPECT_EQ(run.stats()["restarts"]["raytracer"], 2);
}
