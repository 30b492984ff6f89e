// SPDX-License-Identifier: Apache-2.0
//
// A hostile tracker attempts the attacks listed in docs/security.md. The attacks must fail, and the video must be
// complete.
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

constexpr std::uint64_t frames = 60, attacked_frame = 20;

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
    // `victim` is the pid of a process that is attacked instead of the host, because a killed host cannot report.
    void start_it(pid_t victim = 0, const std::vector<std::string> &more = {}) {
        std::vector<std::string> arguments = {"--config", "run.yaml"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        start(arguments, [this, victim] {
            ::setenv("HOSTILE_HOST", std::to_string(victim ? victim : ::getpid()).c_str(), 1);
            for (const char *secret : {"HOSTILE_SECRET", "VK_TOKEN", "LD_ACCESS_TOKEN"})
                ::setenv(secret, "sesame", 1);
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

// A process that does nothing and serves as a target of attacks.
class Victim {
public:
    Victim() : pid_(::fork()) {
        if (pid_ != 0)
            return;
        ::prctl(PR_SET_PTRACER, PR_SET_PTRACER_ANY, 0, 0,
                0); // allows ptrace even if the Yama security module restricts it
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

// Also checks that each overlay belongs to its frame. Only the frame of the attack and the `before` frames preceding
// it may have no overlay.
void expect_complete_video(const ArhostRun &run, std::uint64_t before = 0) {
    expect_frames_in_order(run);
    const auto lines = counted(run, "out/counted.txt");
    for (std::uint64_t i = 0; i < lines.size(); ++i) {
        if (i + before < attacked_frame || i > attacked_frame || lines[i].overlay != "none") {
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
    return level().substr(0, level().find("MISSING")).find(layer) != std::string::npos;
}

// Checks that the attacks were attempted, that all were stopped, and that the plugin continued.
void expect_stopped(HostileRun &run) {
    ASSERT_EQ(run.attack(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr(": stopped"));
    EXPECT_THAT(run.output(), Not(HasSubstr("SUCCEEDED")));
    EXPECT_EQ(run.target_text(), "secret");
    EXPECT_EQ(run.stats()["restarts"]["tracker"], 0) << run.output();
    expect_complete_video(run);
}

// Returns the expected exit status: 1 if a frame has no overlay, else 0.
int status_by_overlays(const ArhostRun &run) {
    const auto lines = counted(run, "out/counted.txt");
    return std::any_of(lines.begin(), lines.end(), [](const CountedLine &line) { return line.overlay == "none"; });
}

// Checks that the plugin was terminated because of `reason`, a contract violation, and then restarted.
void expect_ended(HostileRun &run, const std::string &reason, std::uint64_t before = 0) {
    const int status = run.attack();
    EXPECT_EQ(status, status_by_overlays(run)) << run.output();
    EXPECT_THAT(run.output(), HasSubstr(reason));
    EXPECT_THAT(run.output(), Not(HasSubstr("SUCCEEDED")));
    EXPECT_GT(run.stats()["restarts"]["tracker"], 0);
    expect_complete_video(run, before);
}

// Sanitizers need child processes (for leak checks and stack traces) and unlimited memory, so the sandbox allows
// both.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define REQUIRE_NO_SANITIZER() GTEST_SKIP() << "under a sanitizer the sandbox allows processes and all memory"
#else
#define REQUIRE_NO_SANITIZER() static_cast<void>(0)
#endif
#define REQUIRE_LAYER(name)                                                                                          \
    if (!has(name))                                                                                                  \
    GTEST_SKIP() << "this machine lacks '" << name << "': " << level()

} // namespace

// Verifies that the attacks succeed without the sandbox; otherwise the tests below would prove nothing.
class WithoutSandbox : public testing::TestWithParam<std::string> {};

TEST_P(WithoutSandbox, AttacksSucceed) {
    HostileRun run(GetParam(), "", "sandbox: none\n");
    const Victim victim;
    run.start_it(victim.pid());
    run.wait();
    EXPECT_THAT(run.output(), HasSubstr("SUCCEEDED"));
    // Attacks that succeed only with more rights than an ordinary user has, or with a certain kernel feature.
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

TEST(Sandbox, BlocksReadingUnlistedFiles) {
    REQUIRE_LAYER("landlock");
    HostileRun run("read");
    expect_stopped(run);
}

TEST(Sandbox, BlocksWriting) {
    if (!has("landlock"))
        REQUIRE_LAYER("mount");
    HostileRun run("write");
    expect_stopped(run);
    HostileRun disk("disk");
    expect_stopped(disk);
}

TEST(Sandbox, BlocksDevices) {
    if (!has("landlock"))
        REQUIRE_LAYER("mount");
    HostileRun run("devices");
    expect_stopped(run);
}

TEST(Sandbox, HidesSecretsInTheEnvironment) {
    REQUIRE_LAYER("landlock"); // protects the launcher's files in /proc
    HostileRun run("environment");
    expect_stopped(run);
}

TEST(Sandbox, BlocksSockets) {
    REQUIRE_LAYER("seccomp");
    HostileRun run("sockets");
    expect_stopped(run);
}

TEST(Sandbox, BlocksProcesses) {
    REQUIRE_NO_SANITIZER();
    REQUIRE_LAYER("seccomp");
    HostileRun run("processes");
    expect_stopped(run);
}

TEST(Sandbox, BlocksTracingTheHost) {
    REQUIRE_NO_SANITIZER();
    REQUIRE_LAYER("seccomp");
    REQUIRE_LAYER("landlock");
    HostileRun run("trace");
    expect_stopped(run);
}

TEST(Sandbox, BlocksSignals) {
    REQUIRE_NO_SANITIZER();
    REQUIRE_LAYER("seccomp");
    HostileRun run("signal");
    expect_stopped(run);
}

// A plugin with `processes` may signal its children; before Landlock version 6, it can signal any process.
TEST(Sandbox, WithProcessesSignalsReachOthersOnlyOnOldKernels) {
    REQUIRE_NO_SANITIZER();
    REQUIRE_LAYER("seccomp");
    const bool scoped = has("signals");
    for (const char *attack : {"signal", "signal_by_child"}) {
        SCOPED_TRACE(attack);
        HostileRun run(attack, ", allow: [processes]");
        const Victim victim; // receives the signals instead of the host
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
        expect_complete_video(run);
    }
    HostileRun strict("none", ", allow: [processes]", "sandbox: strict\n");
    const int status = strict.attack(); // the message may name other missing layers, too
    const bool refused = strict.output().find("blocking signals to other processes") != std::string::npos;
    EXPECT_EQ(refused, !scoped) << strict.output();
    EXPECT_TRUE(!refused || status == 2) << status;
}

TEST(Sandbox, LimitsMemory) {
    REQUIRE_NO_SANITIZER();
    HostileRun run("memory", ", memory_mb: 300");
    ASSERT_EQ(run.attack(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("half a GiB: stopped"));
    EXPECT_THAT(run.output(), Not(HasSubstr("SUCCEEDED")));
    expect_complete_video(run);
}

// The host must still be able to pass descriptors to a new worker.
TEST(Sandbox, LimitsDescriptors) {
    HostileRun run("descriptors");
    run.start_it();
    while (run.running() && counted(run, "out/counted.txt").size() < attacked_frame + 5)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    send_signal(run.worker("sink_counter"), SIGKILL);
    ASSERT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr(": stopped"));
    EXPECT_THAT(run.output(), Not(HasSubstr("SUCCEEDED")));
    expect_complete_video(run);
}

// Keeps up to 1,500 descriptors in unread messages, as another program of the same user could do.
class DescriptorsInFlight {
public:
    DescriptorsInFlight() {
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
    ~DescriptorsInFlight() {
        ::close(ends_[0]);
        ::close(ends_[1]);
    }
    DescriptorsInFlight(const DescriptorsInFlight &) = delete;
    DescriptorsInFlight &operator=(const DescriptorsInFlight &) = delete;

private:
    int ends_[2] = {-1, -1};
};

// The scene loader must wait until it can send its descriptors.
TEST(Sandbox, LoadsASceneAlthoughOthersHaveManyDescriptorsInFlight) {
    ArhostRun run(counting("lockstep", "frames: 5", "", ""));
    run.write("scene.yaml", small_scene);
    {
        const DescriptorsInFlight many;
        run.start({"check", "run.yaml"});
        std::this_thread::sleep_for(std::chrono::milliseconds(500));
    }
    EXPECT_EQ(run.wait(), 0) << run.output();
}

TEST(Sandbox, CorruptRingsAndSlotsEndTheWorker) {
    HostileRun run("scribble");
    expect_ended(run, "violation: ", 1); // the plugin may erase its last result before the host has read it
    EXPECT_THAT(run.output(), HasSubstr("make input writable: stopped"));
}

TEST(Sandbox, ReportsATooSmallMemoryLimit) {
    REQUIRE_NO_SANITIZER();
    ArhostRun run("version: 1\nsource: {plugin: source_synthetic}\n"
                  "tracker: {plugin: tracker_aruco, markers: [{id: 0, side_mm: 80}], memory_mb: 1}\n"
                  "outputs: [{plugin: sink_null}]\n");
    EXPECT_EQ(run.run(), 2);
    EXPECT_THAT(run.output(), HasSubstr("'memory_mb' may be too small"));
}

TEST(Sandbox, RejectsAMemoryLimitWithAGpu) {
    ArhostRun run("version: 1\nsource: {plugin: source_synthetic}\n"
                  "tracker: {plugin: tracker_aruco, markers: [{id: 0, side_mm: 80}], memory_mb: 100, allow: [gpu]}\n"
                  "outputs: [{plugin: sink_null}]\n");
    EXPECT_EQ(run.run({"check", "run.yaml"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("run.yaml:3:"));
    EXPECT_THAT(run.output(), HasSubstr("memory_mb: cannot be enforced together with 'allow: [gpu]'"));
}

// The plugin changes data between the host's check and use. This may result in a wrong pose, which cannot be
// detected.
TEST(Sandbox, SurvivesConcurrentChangesOfRingsAndSlots) {
    for (int i = 0; i < 3; ++i) {
        HostileRun run("race");
        const int status = run.attack();
        EXPECT_EQ(status, status_by_overlays(run)) << run.output();
        EXPECT_THAT(run.output(), HasSubstr("start no race: stopped"));
        expect_frames_in_order(run);
    }
}

TEST(Sandbox, BlocksTruncatingSharedMemory) {
    HostileRun run("truncate");
    expect_ended(run, "violation: ", 1);
    EXPECT_THAT(run.output(), HasSubstr("open and truncate: stopped"));
}

TEST(Sandbox, MalformedMessagesEndTheWorker) {
    for (const char *attack : {"no_json", "wrong_types", "out_of_turn", "nested"}) {
        SCOPED_TRACE(attack);
        HostileRun run(attack);
        const int status = run.attack();
        EXPECT_EQ(status, status_by_overlays(run)) << run.output();
        EXPECT_GT(run.stats()["restarts"]["tracker"], 0) << run.output();
        expect_complete_video(run);
    }
    // "empty" has the effect of a closed channel; the socket rejects "oversized".
    for (const char *attack : {"empty", "oversized"}) {
        HostileRun run(attack);
        const int status = run.attack();
        EXPECT_EQ(status, status_by_overlays(run)) << run.output();
        expect_complete_video(run);
    }
}

TEST(Sandbox, AFloodedDoorbellEndsTheWorker) {
    HostileRun run("doorbell");
    expect_ended(run, "floods its doorbell");
}

TEST(Sandbox, AFloodOfMessagesEndsTheWorker) {
    for (const char *attack : {"large_messages", "small_messages"}) {
        SCOPED_TRACE(attack);
        HostileRun run(attack);
        expect_ended(run, "protocol violation: it floods its control channel with messages");
    }
}

TEST(Sandbox, OneBudgetLimitsTheLinesOfAWorker) {
    for (const char *attack : {"failures", "lines"}) {
        SCOPED_TRACE(attack);
        HostileRun run(attack);
        run.start_it(0, {"-v"});
        ASSERT_EQ(run.wait(), 0);
        const std::string output = run.output();
        EXPECT_LT(std::count(output.begin(), output.end(), '\n'), 400);
        EXPECT_EQ(run.stats()["restarts"]["tracker"], 0);
        expect_complete_video(run);
    }
}

TEST(Sandbox, RefusesAnImplausibleLens) {
    ArhostRun run("version: 1\nsource: {plugin: hostile_source, options: {attack: lens}}\n"
                  "tracker: {plugin: tracker_counter, markers: [{id: 3, side_mm: 80}]}\n"
                  "raytracer: {plugin: rt_counter, scene: scene.yaml}\noutputs: [{plugin: sink_null}]\n");
    run.write("scene.yaml", small_scene);
    EXPECT_EQ(run.run(), 2);
    EXPECT_THAT(run.output(), HasSubstr("run.yaml:2:"));
    EXPECT_THAT(run.output(), HasSubstr("the lens distortion is implausible: near the principal point it scales "
                                        "distances by "));
}

TEST(Sandbox, ASecondHelloEndsTheWorker) {
    HostileRun run("second_hello", "", "restart: {first_delay_ms: 1, quarantine_after: 2}\n");
    EXPECT_NE(run.attack(), 0);
    EXPECT_THAT(run.output(), HasSubstr("protocol violation: unexpected message \"hello\""));
}

// A stop that reports progress forever must not outlast a signal to the host by more than stop_deadline_ms.
TEST(Sandbox, OneSignalEndsARunWhosePluginReportsProgressForever) {
    HostileRun run("endless_stop");
    run.start_it(0, {"--set", "source.stop_deadline_ms=400", "--set", "tracker.stop_deadline_ms=400", "--set",
                     "raytracer.stop_deadline_ms=400", "--set", "outputs[0].stop_deadline_ms=400"});
    while (run.running() && counted(run, "out/counted.txt").size() < frames)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    send_signal(run.pid(), SIGTERM);
    EXPECT_EQ(run.wait(), 1) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("not stopped within 400 ms after the signal (stop_deadline_ms): tracker; "));
    expect_complete_video(run);
}

TEST(Sandbox, DescriptorFlagsDoNotBlockTheHost) {
    HostileRun run("flags");
    expect_stopped(run);
}

TEST(Sandbox, KillsAWorkerThatIgnoresSignals) {
    HostileRun run("deaf");
    expect_ended(run, "hung");
}

// A plugin must not be able to redirect or block the host's own output files, even if it may write to their folder.
TEST(Sandbox, HostDoesNotOpenPlantedLinksOrPipes) {
    for (const char *attack : {"link", "pipe"}) {
        SCOPED_TRACE(attack);
        HostileRun run(attack, "", "sandbox: none\n");
        ASSERT_EQ(run.attack(), 0) << run.output();
        EXPECT_THAT(run.output(), HasSubstr("SUCCEEDED"));
        EXPECT_EQ(run.target_text(), "secret");
        EXPECT_EQ(run.stats()["frames"]["in"], frames);
        expect_complete_video(run);
        if (!has("landlock"))
            continue;
        HostileRun inside(attack, ", writes: [.]");
        expect_stopped(inside);
    }
}

TEST(Sandbox, StrictNeedsAllLayers) {
    HostileRun run("none", "", "sandbox: strict\n");
    const int status = run.attack();
    if (has("MISSING") || level().find("MISSING") != std::string::npos) {
        EXPECT_EQ(status, 2);
        EXPECT_THAT(run.output(), HasSubstr("'sandbox: strict' requires all layers"));
    } else {
        EXPECT_EQ(status, 0) << run.output();
        expect_complete_video(run);
    }
}

TEST(Sandbox, PluginListReportsTheLayers) {
    EXPECT_THAT(level(), HasSubstr("no_new_privs: yes"));
    EXPECT_THAT(level(), HasSubstr("limits: "));
}

TEST(Sandbox, NeedsMustBeAllowed) {
    const std::string yaml = "version: 1\nsource: {plugin: source_v4l2, options: {device: /dev/none}}\n"
                             "camera: {width: 640, height: 480, fx: 600}\noutputs: [{plugin: sink_null}]\n";
    ArhostRun run(yaml);
    EXPECT_EQ(run.run(), 2);
    EXPECT_THAT(run.output(), HasSubstr("run.yaml:2"));
    EXPECT_THAT(run.output(), HasSubstr("'source_v4l2' needs 'video', which the sandbox blocks: add 'allow: "
                                        "[video]' to source"));
    EXPECT_EQ(run.run({"--config", "run.yaml", "--set", "source.allow=[video]"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("/dev/none"));
    EXPECT_EQ(run.run({"--config", "run.yaml", "--set", "sandbox=none"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("/dev/none"));
}

TEST(Sandbox, WarnsIfAnOutputMayWriteToTheWorkingDirectory) {
    ArhostRun run(counting("lockstep", "frames: 3", "", ""));
    run.write("scene.yaml", small_scene);
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_THAT(run.output(),
                HasSubstr("run.yaml:6:40: outputs[0].path: 'sink_counter' may write to everything in and below '"));
    ASSERT_EQ(run.run({"--config", "run.yaml", "--set", "outputs[0].path=out/counted.txt"}), 0) << run.output();
    EXPECT_THAT(run.output(), Not(HasSubstr("may write to everything")));
}

TEST(Sandbox, ReadsGrantsALibraryInAnotherFolder) {
    REQUIRE_LAYER("landlock");
    ArhostRun run;
    run.run({"plugins"});
    EXPECT_THAT(run.output(), ContainsRegex("linked_elsewhere +cannot be used: .*cannot open shared object file.*"
                                            "'--reads FOLDER' to plugins and conform"));
    run.run({"plugins", "--reads", ARHOST_BINARY_DIRECTORY "/tests/elsewhere"});
    EXPECT_THAT(run.output(), ContainsRegex("linked_elsewhere +cannot be used: .*exports no symbol 'arhost_entry'"));
}

TEST(Sandbox, RejectsUnknownPermissions) {
    HostileRun run("none", ", allow: [vidoe]");
    EXPECT_EQ(run.attack(), 2);
    EXPECT_THAT(run.output(), HasSubstr("tracker.allow[0]"));
    EXPECT_THAT(run.output(), HasSubstr("video"));
}
