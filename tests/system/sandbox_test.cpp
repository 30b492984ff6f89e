// SPDX-License-Identifier: Apache-2.0
//
// A hostile tracker tries what docs/security.md lists; the run's video is whole, and what it tried has failed.
#include "arhost_run.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

using namespace arhost::test;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;
namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t frames = 60, attacked = 20;

class HostileRun : public ArhostRun {
public:
    explicit HostileRun(const std::string &attack, const std::string &more = "", const std::string &settings = "")
        : ArhostRun("version: 1\nsource: {plugin: source_counter, options: {frames: 60, delay_ms: 1}}\n"
                    "tracker: {plugin: hostile, markers: [{id: 3, side_mm: 80}], deadline_ms: 2000, environment: "
                    "[HOSTILE_HOST, HOSTILE_FOLDER], "
                    "options: {attack: " +
                    attack + "}" + more +
                    "}\nraytracer: {plugin: rt_counter, scene: scene.yaml}\n"
                    "outputs: [{plugin: sink_counter, path: out/counted.txt}]\nstats: stats.json\n" +
                    settings) {
        write("scene.yaml", small_scene);
        fs::create_directories(path("out"));
        std::ofstream(target()) << "secret";
        std::ofstream(target().string() + ".other") << "other";
        listen(target().string() + ".socket", false);
        listen(target().string() + ".socket", true);
    }
    ~HostileRun() {
        for (const int fd : listening_)
            ::close(fd);
    }
    HostileRun(const HostileRun &) = delete;
    HostileRun &operator=(const HostileRun &) = delete;
    fs::path target() const { return elsewhere_.path() / "target"; }
    std::string target_text() const { return read_file(target()); }
    // `victim` takes the place of the host, which could not tell how it was killed.
    void start_it(pid_t victim = 0) {
        start({"--config", "run.yaml"}, [this, victim] {
            ::setenv("HOSTILE_HOST", std::to_string(victim ? victim : ::getpid()).c_str(), 1);
            ::setenv("HOSTILE_SECRET", "sesame", 1);
            ::setenv("HOSTILE_FOLDER", elsewhere_.path().c_str(), 1);
        });
    }
    int attack() {
        start_it();
        return wait();
    }

private:
    void listen(const std::string &name, bool is_abstract) {
        sockaddr_un address{AF_UNIX, {}};
        std::copy(name.begin(), name.end(), address.sun_path + is_abstract);
        const int fd = listening_.emplace_back(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
        EXPECT_EQ(::bind(fd, reinterpret_cast<sockaddr *>(&address),
                         static_cast<socklen_t>(sizeof address.sun_family + name.size() + 1)),
                  0);
        ::listen(fd, 1);
    }

    ScratchFolder elsewhere_;
    std::vector<int> listening_;
};

// A process that only waits; whatever becomes of it.
class Victim {
public:
    Victim() : pid_(::fork()) {
        if (pid_ != 0)
            return;
        ::prctl(PR_SET_PTRACER, PR_SET_PTRACER_ANY, 0, 0, 0); // whatever Yama says
        for (;;)
            ::pause();
    }
    ~Victim() {
        ::kill(pid_, SIGKILL);
        ::waitpid(pid_, nullptr, 0);
    }
    Victim(const Victim &) = delete;
    Victim &operator=(const Victim &) = delete;
    pid_t pid() const { return pid_; }
    bool lives() const {
        siginfo_t end{};
        ::waitid(P_PID, static_cast<id_t>(pid_), &end, WEXITED | WNOHANG | WNOWAIT);
        return end.si_pid == 0;
    }

private:
    pid_t pid_;
};

void expect_frames_in_order(const ArhostRun &run) {
    const auto lines = counted(run, "out/counted.txt");
    ASSERT_EQ(lines.size(), frames) << run.output();
    for (std::uint64_t i = 0; i < frames; ++i) {
        ASSERT_EQ(lines[i].sequence, i);
        ASSERT_EQ(lines[i].video, i);
    }
}

// And each overlay is its own; only that of the attack may lack, and what it took `before` it.
void expect_whole_video(const ArhostRun &run, std::uint64_t before = 0) {
    expect_frames_in_order(run);
    const auto lines = counted(run, "out/counted.txt");
    for (std::uint64_t i = 0; i < lines.size(); ++i) {
        if (i + before < attacked || i > attacked || lines[i].overlay != "none") {
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

// The worker was ended for the given reason each time it got that frame, and restarted.
void expect_ended(HostileRun &run, const std::string &reason, std::uint64_t before = 0) {
    ASSERT_EQ(run.attack(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr(reason));
    EXPECT_THAT(run.output(), Not(HasSubstr("SUCCEEDED")));
    EXPECT_GT(run.stats()["restarts"]["tracker"], 0);
    expect_whole_video(run, before);
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

// Without this, the tests below could pass because their plugin tries nothing, or what can't succeed anyway.
class WithoutSandbox : public testing::TestWithParam<std::string> {};

TEST_P(WithoutSandbox, TheSameAttackSucceeds) {
    HostileRun run(GetParam(), "", "sandbox: none\n");
    const Victim victim;
    run.start_it(victim.pid());
    run.wait();
    EXPECT_THAT(run.output(), HasSubstr("SUCCEEDED"));
    // What takes more than an ordinary user's rights, or a kernel that has it.
    const auto is_rare = [](const std::string &line) {
        const std::initializer_list<const char *> rare = {
            "the passwords", "packets", "virtual machines", "launcher", "/dev/", "/run: ", "/: "};
        return ::geteuid() != 0 && std::any_of(rare.begin(), rare.end(), [&](const char *what) {
                   return line.find(what) != std::string::npos;
               });
    };
    std::istringstream lines(run.output());
    for (std::string line; std::getline(lines, line);)
        EXPECT_TRUE(line.find(": stopped") == std::string::npos || is_rare(line)) << line;
}

INSTANTIATE_TEST_SUITE_P(Sandbox, WithoutSandbox,
                         testing::Values("read", "write", "devices", "environment", "sockets", "processes", "trace",
                                         "signal", "memory", "disk", "descriptors"),
                         [](const auto &info) { return info.param; });

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

TEST(Sandbox, NoDeviceIsOpened) {
    if (!has("landlock"))
        REQUIRE_LAYER("mount");
    HostileRun run("devices");
    expect_stopped(run);
}

TEST(Sandbox, NoSecretOfTheEnvironmentIsRead) {
    REQUIRE_LAYER("landlock"); // the launcher's is in /proc
    HostileRun run("environment");
    expect_stopped(run);
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

// What may have processes must be able to signal those, and before Landlock's sixth version that is any single one.
TEST(Sandbox, WithProcessesSignalsReachOthersOnlyOnOlderKernels) {
    REQUIRE_NO_SANITIZER();
    REQUIRE_LAYER("seccomp");
    const bool scoped = has("signals");
    for (const char *attack : {"signal", "signal_by_child"}) {
        SCOPED_TRACE(attack);
        HostileRun run(attack, ", allow: [processes]");
        const Victim victim; // should it be reached, not the host
        run.start_it(victim.pid());
        ASSERT_EQ(run.wait(), 0) << run.output();
        EXPECT_EQ(victim.lives(), scoped) << run.output();
        const std::string call = attack == std::string("signal") ? ": kill: " : ": a child's kill: ";
        EXPECT_THAT(run.output(), HasSubstr(call + (scoped ? "stopped" : "SUCCEEDED")));
        if (attack == std::string("signal_by_child"))
            EXPECT_THAT(run.output(), HasSubstr("its child ends"));
        else
            for (const char *what : {"reach all", "tkill", "pidfd", "a descriptor's owner", "a limit"})
                EXPECT_THAT(run.output(), HasSubstr(std::string(": ") + what + ": stopped"));
        expect_whole_video(run);
    }
    HostileRun strict("none", ", allow: [processes]", "sandbox: strict\n");
    const int status = strict.attack(); // other layers may be missing too
    const bool refused = strict.output().find("signals to processes that are not its own") != std::string::npos;
    EXPECT_EQ(refused, !scoped) << strict.output();
    EXPECT_TRUE(!refused || status == 2) << status;
}

TEST(Sandbox, MemoryEndsAtItsLimit) {
    REQUIRE_NO_SANITIZER();
    HostileRun run("memory", ", memory_mb: 300");
    ASSERT_EQ(run.attack(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("half a GiB: stopped"));
    EXPECT_THAT(run.output(), Not(HasSubstr("SUCCEEDED")));
    expect_whole_video(run);
}

// The host still gives a worker that is started meanwhile its memory.
TEST(Sandbox, DescriptorsAreLeftForOthers) {
    HostileRun run("descriptors");
    run.start_it();
    while (run.running() && counted(run, "out/counted.txt").size() < attacked + 5)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    send_signal(run.worker("sink_counter"), SIGKILL);
    ASSERT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr(": stopped"));
    EXPECT_THAT(run.output(), Not(HasSubstr("SUCCEEDED")));
    expect_whole_video(run);
}

// 1,500 of them, of another program of the user's, which no sandbox bounds; fewer where that may not either.
class DescriptorsUnderWay {
public:
    DescriptorsUnderWay() {
        constexpr std::size_t messages = 6, each = 250;
        if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends_) != 0)
            return;
        char byte = 0;
        iovec part{&byte, 1};
        alignas(cmsghdr) char ancillary[CMSG_SPACE(each * sizeof(int))] = {};
        msghdr message{};
        message.msg_iov = &part;
        message.msg_iovlen = 1;
        message.msg_control = ancillary;
        message.msg_controllen = sizeof ancillary;
        cmsghdr *rights = CMSG_FIRSTHDR(&message);
        rights->cmsg_level = SOL_SOCKET;
        rights->cmsg_type = SCM_RIGHTS;
        rights->cmsg_len = CMSG_LEN(each * sizeof(int));
        for (std::size_t i = 0; i < each; ++i)
            std::memcpy(CMSG_DATA(rights) + i * sizeof(int), &ends_[0], sizeof(int));
        for (std::size_t i = 0; i < messages; ++i)
            (void)!::sendmsg(ends_[1], &message, MSG_DONTWAIT);
    }
    ~DescriptorsUnderWay() {
        ::close(ends_[0]);
        ::close(ends_[1]);
    }
    DescriptorsUnderWay(const DescriptorsUnderWay &) = delete;
    DescriptorsUnderWay &operator=(const DescriptorsUnderWay &) = delete;

private:
    int ends_[2] = {-1, -1};
};

// The scene loader waits until it may hand over what it has loaded.
TEST(Sandbox, ASceneIsLoadedThoughOthersHaveManyDescriptorsUnderWay) {
    ArhostRun run(counting("lockstep", "frames: 5", "", ""));
    run.write("scene.yaml", small_scene);
    {
        const DescriptorsUnderWay many;
        run.start({"check", "run.yaml"});
        std::this_thread::sleep_for(std::chrono::milliseconds(500));
    }
    EXPECT_EQ(run.wait(), 0) << run.output();
}

TEST(Sandbox, ScribbledRingsAndSlotsEndTheirWorker) {
    HostileRun run("scribble");
    expect_ended(run, "violation: ", 1); // it may erase the last result before the host has received it
    EXPECT_THAT(run.output(), HasSubstr("make input writable: stopped"));
}

TEST(Sandbox, APluginForWhichItsMemoryIsTooSmallIsToldSo) {
    REQUIRE_NO_SANITIZER();
    ArhostRun run("version: 1\nsource: {plugin: source_synthetic}\n"
                  "tracker: {plugin: tracker_aruco, markers: [{id: 0, side_mm: 80}], memory_mb: 1}\n"
                  "outputs: [{plugin: sink_null}]\n");
    EXPECT_EQ(run.run(), 2);
    EXPECT_THAT(run.output(), HasSubstr("'memory_mb' may be too small"));
}

TEST(Sandbox, RefusesALimitOfMemoryThatADriverWouldNotKeep) {
    ArhostRun run("version: 1\nsource: {plugin: source_synthetic}\n"
                  "tracker: {plugin: tracker_aruco, markers: [{id: 0, side_mm: 80}], memory_mb: 100, allow: [gpu]}\n"
                  "outputs: [{plugin: sink_null}]\n");
    EXPECT_EQ(run.run({"check", "run.yaml"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("run.yaml:3:"));
    EXPECT_THAT(run.output(), HasSubstr("memory_mb: can't be kept with 'allow: [gpu]'"));
}

// Whatever changes between a check and a use. A wrong pose may be among it, which nothing can tell from a right one.
TEST(Sandbox, ThreadsThatChangeRingsAndSlotsDoNotHarmTheHost) {
    for (int i = 0; i < 3; ++i) {
        HostileRun run("race");
        ASSERT_EQ(run.attack(), 0) << run.output();
        EXPECT_THAT(run.output(), HasSubstr("start no race: stopped"));
        expect_frames_in_order(run);
    }
}

TEST(Sandbox, SharedMemoryIsNotTruncated) {
    HostileRun run("truncate");
    expect_ended(run, "violation: ", 1);
    EXPECT_THAT(run.output(), HasSubstr("open and truncate: stopped"));
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

TEST(Sandbox, WarnsOfAnOutputThatMayWriteInAllOfTheWorkingDirectory) {
    ArhostRun run(counting("lockstep", "frames: 3", "", ""));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("run.yaml:6:40: outputs[0].path: 'sink_counter' can write all of '"));
    ASSERT_EQ(run.run({"--config", "run.yaml", "--set", "outputs[0].path=out/counted.txt"}), 0) << run.output();
    EXPECT_THAT(run.output(), Not(HasSubstr("can write all of")));
}

TEST(Sandbox, ALibraryThatLiesElsewhereIsGivenByReads) {
    REQUIRE_LAYER("landlock");
    ArhostRun run;
    run.run({"plugins"});
    EXPECT_THAT(run.output(), ContainsRegex("linked_elsewhere +can't be used: .*cannot open shared object file.*"
                                            "'--reads FOLDER' of plugins and conform"));
    run.run({"plugins", "--reads", ARHOST_BINARY_DIRECTORY "/tests/elsewhere"});
    EXPECT_THAT(run.output(), ContainsRegex("linked_elsewhere +can't be used: .*exports no symbol 'arhost_entry'"));
}

TEST(Sandbox, AllowsOnlyWhatThereIs) {
    HostileRun run("none", ", allow: [vidoe]");
    EXPECT_EQ(run.attack(), 2);
    EXPECT_THAT(run.output(), HasSubstr("tracker.allow[0]"));
    EXPECT_THAT(run.output(), HasSubstr("video"));
}
