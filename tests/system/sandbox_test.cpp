// SPDX-License-Identifier: Apache-2.0
//
// A hostile tracker tries what docs/security.md lists; the run's video is whole, and what it tried has failed.
#include "arhost_run.hpp"

#include <gmock/gmock.h>

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

using namespace arhost::test;
using testing::HasSubstr;
using testing::Not;
namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t frames = 60, attacked = 20;

class HostileRun : public ArhostRun {
public:
    explicit HostileRun(const std::string &attack, const std::string &more = "", const std::string &settings = "")
        : ArhostRun(
              "version: 1\nsource: {plugin: source_counter, options: {frames: 60, delay_ms: 1}}\n"
              "tracker: {plugin: hostile, markers: [{id: 3, side_mm: 80}], deadline_ms: 2000, options: {attack: " +
              attack + "}" + more +
              "}\nraytracer: {plugin: rt_counter, scene: scene.yaml}\n"
              "outputs: [{plugin: sink_counter, path: out/counted.txt}]\nstats: stats.json\n" +
              settings) {
        write("scene.yaml", small_scene);
        fs::create_directories(path("out"));
        std::ofstream(target()) << "secret";
    }
    fs::path target() const { return elsewhere_.path() / "target"; }
    std::string target_text() const { return read_file(target()); }
    void start_it() {
        start({"--config", "run.yaml"}, [this] {
            ::setenv("HOSTILE_HOST", std::to_string(::getpid()).c_str(), 1);
            ::setenv("HOSTILE_FOLDER", elsewhere_.path().c_str(), 1);
        });
    }
    int attack() {
        start_it();
        return wait();
    }

private:
    ScratchFolder elsewhere_;
};

// Every frame is there once and in order, and each overlay is its own; only that of the attack may lack.
void expect_whole_video(const ArhostRun &run) {
    const auto lines = counted(run, "out/counted.txt");
    ASSERT_EQ(lines.size(), frames) << run.output();
    for (std::uint64_t i = 0; i < frames; ++i) {
        ASSERT_EQ(lines[i].sequence, i);
        ASSERT_EQ(lines[i].video, i);
        if (i != attacked || lines[i].overlay != "none") {
            ASSERT_EQ(lines[i].overlay, std::to_string(i)) << i;
        }
    }
}

const std::string &level() {
    static const std::string text = [] {
        ArhostRun run;
        run.run({"plugins"});
        const std::string output = run.output(), mark = "sandbox on this machine: ";
        return output.find(mark) == std::string::npos ? "" : output.substr(output.find(mark) + mark.size());
    }();
    return text;
}
bool has(const std::string &layer) {
    return level().substr(0, level().find("LACKING")).find(layer) != std::string::npos;
}

// The plugin can try, has tried, and all of it was stopped; it goes on working.
void expect_stopped(HostileRun &run) {
    ASSERT_EQ(run.attack(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr(": stopped"));
    EXPECT_THAT(run.output(), Not(HasSubstr("SUCCEEDED")));
    EXPECT_EQ(run.target_text(), "secret");
    EXPECT_EQ(run.stats()["restarts"]["tracker"], 0) << run.output();
    expect_whole_video(run);
}

// It broke the contract, each time that frame came to it: ended for the reason given, and started again.
void expect_ended(HostileRun &run, const std::string &reason) {
    ASSERT_EQ(run.attack(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr(reason));
    EXPECT_THAT(run.output(), Not(HasSubstr("SUCCEEDED")));
    EXPECT_GT(run.stats()["restarts"]["tracker"], 0);
    expect_whole_video(run);
}

// Whose leak checker and stack traces need processes, and whose shadow memory no limit.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define REQUIRE_NO_SANITIZER() GTEST_SKIP() << "under a sanitizer the sandbox allows processes and all memory"
#else
#define REQUIRE_NO_SANITIZER() static_cast<void>(0)
#endif
#define REQUIRE_LAYER(name)                                                                                          \
    if (!has(name))                                                                                                  \
    GTEST_SKIP() << "this machine lacks '" << name << "': " << level()

} // namespace

// Without this, the tests below could pass because their plugin tries nothing.
TEST(Sandbox, WithoutItTheSameAttacksSucceed) {
    for (const char *attack : {"read", "write", "sockets", "processes"}) {
        HostileRun run(attack, "", "sandbox: none\n");
        run.attack();
        EXPECT_THAT(run.output(), HasSubstr("SUCCEEDED")) << attack;
    }
}

TEST(Sandbox, NoFileOutsideTheListIsRead) {
    REQUIRE_LAYER("landlock");
    HostileRun run("read");
    expect_stopped(run);
}

TEST(Sandbox, NothingIsWritten) {
    if (!has("landlock"))
        REQUIRE_LAYER("mount");
    HostileRun run("write");
    expect_stopped(run);
    HostileRun disk("disk");
    expect_stopped(disk);
}

TEST(Sandbox, NoSocketIsOpened) {
    REQUIRE_LAYER("seccomp");
    HostileRun run("sockets");
    expect_stopped(run);
}

TEST(Sandbox, NoProcessIsStarted) {
    REQUIRE_NO_SANITIZER();
    REQUIRE_LAYER("seccomp");
    HostileRun run("processes");
    expect_stopped(run);
}

TEST(Sandbox, TheHostIsNotTraced) {
    REQUIRE_NO_SANITIZER();
    REQUIRE_LAYER("seccomp");
    REQUIRE_LAYER("landlock");
    HostileRun run("trace");
    expect_stopped(run);
}

TEST(Sandbox, TheHostIsNotSignalled) {
    REQUIRE_NO_SANITIZER();
    REQUIRE_LAYER("seccomp");
    HostileRun run("signal");
    expect_stopped(run);
}

TEST(Sandbox, MemoryEndsAtItsLimit) {
    REQUIRE_NO_SANITIZER();
    HostileRun run("memory", ", memory_mb: 300");
    ASSERT_EQ(run.attack(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("a GiB: stopped"));
    EXPECT_THAT(run.output(), Not(HasSubstr("SUCCEEDED")));
    expect_whole_video(run);
}

// The host still gives a worker that is started meanwhile its memory.
TEST(Sandbox, DescriptorsAreLeftForOthers) {
    HostileRun run("descriptors");
    run.start_it();
    while (run.running() && counted(run, "out/counted.txt").size() < attacked + 5)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    ::kill(run.worker("sink_counter"), SIGKILL);
    ASSERT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr(": stopped"));
    EXPECT_THAT(run.output(), Not(HasSubstr("SUCCEEDED")));
    expect_whole_video(run);
}

TEST(Sandbox, ScribbledRingsAndSlotsEndTheirWorker) {
    HostileRun run("scribble");
    expect_ended(run, "broke the contract");
    EXPECT_THAT(run.output(), HasSubstr("make input writable: stopped"));
}

TEST(Sandbox, SharedMemoryIsNotTruncated) {
    HostileRun run("truncate");
    expect_ended(run, "open and truncate: stopped");
}

TEST(Sandbox, MalformedMessagesEndTheirWorker) {
    for (const char *attack : {"no_json", "wrong_types", "out_of_turn", "nested"}) {
        SCOPED_TRACE(attack);
        HostileRun run(attack);
        ASSERT_EQ(run.attack(), 0) << run.output();
        EXPECT_GT(run.stats()["restarts"]["tracker"], 0) << run.output();
        expect_whole_video(run);
    }
    for (const char *attack : {"empty", "oversized"}) { // as if it had closed its end; refused by the socket
        HostileRun run(attack);
        ASSERT_EQ(run.attack(), 0) << run.output();
        expect_whole_video(run);
    }
}

TEST(Sandbox, AFloodedDoorbellEndsItsWorker) {
    HostileRun run("doorbell");
    expect_ended(run, "floods its doorbell");
}

TEST(Sandbox, NoFlagOfADescriptorStopsTheHost) {
    HostileRun run("flags");
    expect_stopped(run);
}

TEST(Sandbox, AWorkerThatIgnoresAllSignalsIsKilled) {
    HostileRun run("deaf");
    expect_ended(run, "hung");
}

// What the host itself writes can't be led elsewhere or halted, even where the plugin may write beside it.
TEST(Sandbox, WhatLiesInWaitForTheHostIsNotOpened) {
    for (const char *attack : {"link", "pipe"}) {
        SCOPED_TRACE(attack);
        HostileRun run(attack, "", "sandbox: none\n");
        ASSERT_EQ(run.attack(), 0) << run.output();
        EXPECT_THAT(run.output(), HasSubstr("SUCCEEDED"));
        EXPECT_EQ(run.target_text(), "secret");
        EXPECT_EQ(run.stats()["frames"]["in"], frames);
        expect_whole_video(run);
        if (!has("landlock"))
            continue;
        HostileRun inside(attack, ", writes: [.]");
        expect_stopped(inside);
    }
}

TEST(Sandbox, StrictRunsOnlyWhereAllLayersAre) {
    HostileRun run("none", "", "sandbox: strict\n");
    const int status = run.attack();
    if (has("LACKING") || level().find("LACKING") != std::string::npos) {
        EXPECT_EQ(status, 2);
        EXPECT_THAT(run.output(), HasSubstr("'sandbox: strict' asks for all of it"));
    } else {
        EXPECT_EQ(status, 0) << run.output();
        expect_whole_video(run);
    }
}

TEST(Sandbox, ThePluginListSaysHowFarItIsReached) {
    EXPECT_THAT(level(), HasSubstr("no_new_privs: yes"));
    EXPECT_THAT(level(), HasSubstr("limits: "));
}

TEST(Sandbox, WhatAPluginNeedsMustBeAllowed) {
    const std::string yaml = "version: 1\nsource: {plugin: source_v4l2, options: {device: /dev/none}}\n"
                             "camera: {width: 640, height: 480, fx: 600}\noutputs: [{plugin: sink_null}]\n";
    ArhostRun run(yaml);
    EXPECT_EQ(run.run(), 2);
    EXPECT_THAT(run.output(), HasSubstr("run.yaml:2"));
    EXPECT_THAT(run.output(), HasSubstr("'source_v4l2' needs 'video', which the sandbox keeps from it: add 'allow: "
                                        "[video]' to source"));
    EXPECT_EQ(run.run({"--config", "run.yaml", "--set", "source.allow=[video]"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("/dev/none"));
    EXPECT_EQ(run.run({"--config", "run.yaml", "--set", "sandbox=none"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("/dev/none"));
}

TEST(Sandbox, AllowsOnlyWhatThereIs) {
    HostileRun run("none", ", allow: [vidoe]");
    EXPECT_EQ(run.attack(), 2);
    EXPECT_THAT(run.output(), HasSubstr("tracker.allow[0]"));
    EXPECT_THAT(run.output(), HasSubstr("video"));
}
