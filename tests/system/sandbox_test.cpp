// SPDX-License-Identifier: Apache-2.0
//
// A hostile tracker attempts the attacks listed in docs/security.md. The attacks must fail, and the video must be
// complete.
#include "arhost_run.hpp"
#include "attacks.hpp"
#include "documents.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <algorithm>
#include <grp.h>
#include <linux/sched.h>
#include <map>
#include <sched.h>
#include <seccomp.h>
#include <set>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <sys/msg.h>
#include <sys/prctl.h>
#include <sys/sem.h>
#include <sys/shm.h>
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

// System V objects that a plugin must not reach.
class SystemVObjects {
public:
    SystemVObjects()
        : shared_(::shmget(IPC_PRIVATE, 4096, IPC_CREAT | 0666)), queue_(::msgget(IPC_PRIVATE, IPC_CREAT | 0666)),
          semaphores_(::semget(IPC_PRIVATE, 1, IPC_CREAT | 0666)) {}
    ~SystemVObjects() {
        ::shmctl(shared_, IPC_RMID, nullptr);
        ::msgctl(queue_, IPC_RMID, nullptr);
        ::semctl(semaphores_, 0, IPC_RMID);
    }
    SystemVObjects(const SystemVObjects &) = delete;
    SystemVObjects &operator=(const SystemVObjects &) = delete;
    void tell_by_environment() const {
        ::setenv("HOSTILE_SHM", std::to_string(shared_).c_str(), 1);
        ::setenv("HOSTILE_QUEUE", std::to_string(queue_).c_str(), 1);
        ::setenv("HOSTILE_SEMAPHORES", std::to_string(semaphores_).c_str(), 1);
    }

private:
    int shared_, queue_, semaphores_;
};

// A terminal, which arhost is started in.
class Terminal {
public:
    Terminal() : controller_(::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC)) {
        ::grantpt(controller_);
        ::unlockpt(controller_);
        char name[64] = "";
        ::ptsname_r(controller_, name, sizeof name);
        path_ = name;
    }
    ~Terminal() { ::close(controller_); }
    Terminal(const Terminal &) = delete;
    Terminal &operator=(const Terminal &) = delete;
    const std::string &path() const { return path_; }
    void control_this_session() const {
        ::setsid();
        ::ioctl(::open(path_.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC), TIOCSCTTY, 0);
        ::setenv("HOSTILE_TERMINAL", path_.c_str(), 1);
    }

private:
    int controller_;
    std::string path_;
};

class HostileRun : public ArhostRun {
public:
    explicit HostileRun(const std::string &attack, const std::string &more = "", const std::string &settings = "")
        : ArhostRun(
              "version: 1\nsource: {plugin: source_counter, options: {frames: 60, delay_ms: 1}}\n"
              "tracker: {plugin: hostile, targets: [{marker: 3, family: tag36h11, side_mm: 80}], deadline_ms: 2000, "
              "environment: "
              "[HOSTILE_HOST, HOSTILE_FOLDER, HOSTILE_HOME, HOSTILE_SHM, HOSTILE_QUEUE, HOSTILE_SEMAPHORES, "
              "HOSTILE_TERMINAL], "
              "options: {attack: " +
              attack + "}" + more +
              "}\nraytracer: {plugin: rt_counter, scene: scene.yaml}\n"
              "outputs: [{plugin: sink_counter, path: out/counted.txt}]\nstats: stats.json\n" +
              settings) {
        write("scene.yaml", small_scene);
        fs::create_directories(path("out"));
        std::ofstream(target()) << "secret";
        std::ofstream(target().string() + ".other") << "other";
        fs::create_symlink(target(), target().string() + ".alias");
        listen(target().string() + ".socket", false);
        listen(target().string() + ".socket", true);
        ::listen(listening_.emplace_back(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)), 1);
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
    // `more`: further arguments. `prepare` is called in the child process before exec.
    void start_it(
        pid_t victim = 0, const std::function<void()> &prepare = [] {}, const std::vector<std::string> &more = {}) {
        std::vector<std::string> arguments = {"--config", "run.yaml"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        start(arguments, [this, victim, &prepare] {
            system_v_.tell_by_environment();
            ::setenv("HOSTILE_HOST", std::to_string(victim ? victim : ::getpid()).c_str(), 1);
            for (const char *secret : {"HOSTILE_SECRET", "VK_TOKEN", "LD_ACCESS_TOKEN"})
                ::setenv(secret, "sesame", 1);
            ::setenv("HOSTILE_FOLDER", elsewhere_.path().c_str(), 1);
            if (const char *home = std::getenv("HOME"))
                ::setenv("HOSTILE_HOME", home, 1);
            terminal_.control_this_session();
            prepare();
        });
    }
    // Makes another user the owner of all files.
    void give_to(uid_t user) const {
        for (const fs::path &folder : {path("."), elsewhere_.path()}) {
            for (const auto &entry : fs::recursive_directory_iterator(folder))
                EXPECT_EQ(::lchown(entry.path().c_str(), user, user), 0);
            EXPECT_EQ(::lchown(folder.c_str(), user, user), 0);
        }
        EXPECT_EQ(::chown(terminal_.path().c_str(), user, user), 0);
    }
    // `more`: further arguments.
    int attack(const std::vector<std::string> &more = {}) {
        start_it(
            0, [] {}, more);
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
    SystemVObjects system_v_;
    Terminal terminal_;
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

// Expects that only the frame of the attack and the `before` frames preceding it may have no overlay, and that each
// overlay belongs to its frame.
void expect_complete_video(const ArhostRun &run, std::uint64_t before = 0) {
    for (const std::uint64_t plain : expect_all_frames(run, frames, "out/counted.txt")) {
        EXPECT_GE(plain + before, attacked_frame) << run.output();
        EXPECT_LE(plain, attacked_frame) << run.output();
    }
}

const std::string &level() {
    static const std::string text = [] {
        ArhostRun run;
        run.run({"plugins", "source_counter"});
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

// Returns the expected exit status: 1 if a frame has no overlay because a component failed, else 0.
int status_by_overlays(const ArhostRun &run) {
    return run.stats()["frames"]["passed_unaugmented"].empty() ? 0 : 1;
}

// Checks that the plugin was terminated because of `reason`, a contract violation, and then restarted.
void expect_ended(HostileRun &run, const std::string &reason, std::uint64_t before = 0,
                  const std::vector<std::string> &more = {}) {
    const int status = run.attack(more);
    EXPECT_EQ(status, status_by_overlays(run)) << run.output();
    EXPECT_THAT(run.output(), HasSubstr(reason));
    EXPECT_THAT(run.output(), Not(HasSubstr("SUCCEEDED")));
    EXPECT_GT(run.stats()["restarts"]["tracker"], 0);
    expect_complete_video(run, before);
}

// Returns a path at or above arhost that ordinary users cannot access, or "".
fs::path closed_folder() {
    for (fs::path path = arhost::test::build_directory() + "/bin/arhost"; path.has_relative_path();
         path = path.parent_path())
        if ((fs::status(path).permissions() & fs::perms::others_exec) == fs::perms::none)
            return path;
    return {};
}

// Sanitizers need child processes (for leak checks and stack traces) and unlimited memory, so the sandbox allows
// both.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define REQUIRE_NO_SANITIZER() GTEST_SKIP() << "under a sanitizer the sandbox allows processes and all memory"
#else
#define REQUIRE_NO_SANITIZER() static_cast<void>(0)
#endif
#define REQUIRE_ACCESS_OF_ORDINARY_USERS()                                                                           \
    if (const fs::path folder = closed_folder(); !folder.empty())                                                    \
    GTEST_SKIP() << "ordinary users cannot access " << folder
#define REQUIRE_LAYER(name)                                                                                          \
    if (!has(name))                                                                                                  \
    GTEST_SKIP() << "this machine lacks '" << name << "': " << level()

} // namespace

namespace {

// Returns what became of the attacks of a group: "stopped, REASON" or "SUCCEEDED"; the keys are Attack::what.
std::map<std::string, std::string> outcomes(const HostileRun &run, const std::string &group) {
    std::map<std::string, std::string> found;
    std::istringstream lines(run.output());
    const std::string mark = ": " + group + ": ";
    for (std::string line; std::getline(lines, line);)
        if (const std::size_t begin = line.find(mark); begin != std::string::npos) {
            const std::string text = line.substr(begin + mark.size());
            const std::size_t end = text.find(": s") != std::string::npos ? text.find(": s") : text.find(": S");
            if (end != std::string::npos)
                found[text.substr(0, end)] = text.substr(end + 2);
        }
    return found;
}

bool is_privileged() {
    const pid_t child = ::fork();
    if (child == 0)
        ::_exit(::unshare(CLONE_NEWNS) != 0);
    int status = 1;
    ::waitpid(child, &status, 0);
    return ::geteuid() == 0 && status == 0;
}

template <std::size_t size> bool is_in(const char *const (&list)[size], const std::string &what) {
    return std::ranges::find(list, what) != std::end(list);
}

} // namespace

// Verifies that the attacks succeed without the sandbox; otherwise the tests below would prove nothing.
class WithoutSandbox : public testing::TestWithParam<std::string> {};

TEST_P(WithoutSandbox, AttacksSucceed) {
    HostileRun run(GetParam(), "", "sandbox: none\n");
    const Victim victim;
    run.start_it(victim.pid());
    run.wait();
    EXPECT_THAT(run.output(), HasSubstr("SUCCEEDED"));
    for (const auto &[what, outcome] : outcomes(run, GetParam())) {
        const bool is_rare = is_in(stopped_by_the_session, what) || is_in(need_a_feature, what) ||
                             (is_in(need_privileges, what) && !is_privileged());
        EXPECT_TRUE(outcome == "SUCCEEDED" || is_rare) << what << ": " << outcome;
    }
}

INSTANTIATE_TEST_SUITE_P(Sandbox, WithoutSandbox,
                         testing::Values("read", "write", "metadata", "devices", "environment", "sockets", "system_v",
                                         "processes", "trace", "signal", "memory", "code", "threads", "disk",
                                         "descriptors", "exhaust", "kernel", "terminal"),
                         [](const auto &info) { return info.param; });

// ---- docs/security.md: each attack of attacks.hpp ---------------------------------------------------

namespace {

// Settings of the configuration that an attack needs.
std::string settings_for(const std::string &group) {
    if (group == "memory")
        return ", memory_mb: 300";
    return group == "terminal" ? ", allow: [processes]" : "";
}

// How arhost is run: by whom, and without which layers. In a container, a part of /proc is covered, and then the
// kernel refuses another /proc.
struct Setting {
    const char *name;
    bool is_ordinary_user, has_namespaces, has_landlock, covers_proc = false;
};
constexpr Setting usual{"usual", false, true, true};
constexpr Setting settings[] = {{"ordinary_user", true, true, true},
                                {"no_namespaces", false, false, true},
                                {"no_landlock", false, true, false},
                                {"ordinary_user_no_namespaces", true, false, true},
                                {"ordinary_user_no_landlock", true, true, false},
                                {"covered_proc", true, true, false, true}};
constexpr uid_t nobody = 65534;

// Makes the calling process lose rights, as containers and administrators do.
void forbid(std::initializer_list<const char *> calls, int error) {
    const scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ALLOW);
    for (const char *call : calls)
        seccomp_rule_add(filter, SCMP_ACT_ERRNO(static_cast<unsigned>(error)), seccomp_syscall_resolve_name(call), 0);
    if (error == EPERM)
        for (const std::uint64_t flag : {CLONE_NEWUSER, CLONE_NEWPID})
            seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(clone), 1,
                             SCMP_CMP64(0, SCMP_CMP_MASKED_EQ, flag, flag));
    if (seccomp_load(filter) != 0)
        ::_exit(125);
    seccomp_release(filter);
}
void apply(const Setting &setting) {
    if (setting.covers_proc &&
        (::unshare(CLONE_NEWNS) != 0 || ::mount("", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
         ::mount("tmpfs", "/proc/bus", "tmpfs", 0, nullptr) != 0))
        ::_exit(123);
    if (!setting.has_namespaces)
        forbid({"unshare", "setns", "mount", "pivot_root", "open_tree", "move_mount", "mount_setattr"}, EPERM);
    if (!setting.has_landlock)
        forbid({"landlock_create_ruleset"}, ENOSYS);
    if (setting.is_ordinary_user && ::geteuid() == 0 &&
        (::setgroups(0, nullptr) != 0 || ::setgid(nobody) != 0 || ::setuid(nobody) != 0))
        ::_exit(125);
}

// Also checks that arhost continued, and that the plugin attempted exactly the attacks of attacks.hpp.
std::map<std::string, std::string> outcomes(const std::string &group, const Setting &setting) {
    HostileRun run(group, settings_for(group));
    if (setting.is_ordinary_user && ::geteuid() == 0)
        run.give_to(nobody);
    run.start_it(0, [&] { apply(setting); }, {"--set", "tracker.deadline_ms=30000"}); // virtual machines are slow
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_EQ(run.target_text(), "secret");
    EXPECT_EQ(run.stats()["restarts"]["tracker"], 0) << run.output();
    expect_complete_video(run);
    const auto found = outcomes(run, group);
    std::set<std::string> attempted, listed;
    for (const auto &[what, outcome] : found)
        attempted.insert(what);
    for (const Attack &attack : attacks)
        if (attack.group == group)
            listed.insert(attack.what);
    EXPECT_EQ(attempted, listed);
    return found;
}

unsigned layers_of_this_machine() {
    return (has("mount") && has("pid") ? unsigned(by_namespaces) : 0) |
           (has("landlock: version") ? unsigned(by_landlock) : 0) | by_other_layers;
}

std::string name_of(const Attack &attack) {
    std::string name = std::string(attack.group) + "_" + attack.what;
    std::ranges::replace_if(
        name, [](unsigned char c) { return !std::isalnum(c); }, '_');
    return name;
}

} // namespace

class Attacks : public testing::TestWithParam<Attack> {};

TEST_P(Attacks, AreStopped) {
    REQUIRE_NO_SANITIZER();
    const Attack &attack = GetParam();
    if (!(attack.stopped_by & layers_of_this_machine()))
        GTEST_SKIP() << "this machine lacks a layer that stops it: " << level();
    const auto found = outcomes(attack.group, usual);
    ASSERT_TRUE(found.contains(attack.what));
    EXPECT_THAT(found.at(attack.what), testing::StartsWith("stopped"));
}

INSTANTIATE_TEST_SUITE_P(Sandbox, Attacks, testing::ValuesIn(attacks),
                         [](const auto &info) { return name_of(info.param); });

class AttacksInSettings : public testing::TestWithParam<std::tuple<std::string, Setting>> {};

TEST_P(AttacksInSettings, AreStopped) {
    REQUIRE_NO_SANITIZER();
    const auto &[group, setting] = GetParam();
    if (setting.covers_proc && !is_privileged())
        GTEST_SKIP() << "only root can cover a part of /proc";
    if (setting.is_ordinary_user)
        REQUIRE_ACCESS_OF_ORDINARY_USERS();
    unsigned layers = layers_of_this_machine();
    layers &= setting.has_namespaces ? ~0u : ~unsigned(by_namespaces);
    layers &= setting.has_landlock ? ~0u : ~unsigned(by_landlock);
    const auto found = outcomes(group, setting);
    for (const Attack &attack : attacks)
        if (attack.group == group && (attack.stopped_by & layers) && found.contains(attack.what)) {
            EXPECT_THAT(found.at(attack.what), testing::StartsWith("stopped")) << attack.what;
        }
}

INSTANTIATE_TEST_SUITE_P(
    Sandbox, AttacksInSettings,
    testing::Combine(testing::Values("read", "metadata", "write", "devices", "environment", "terminal", "system_v",
                                     "sockets", "processes", "trace", "signal", "memory", "code", "disk",
                                     "descriptors", "exhaust", "kernel"),
                     testing::ValuesIn(settings)),
    [](const auto &info) { return std::get<0>(info.param) + "_" + std::get<1>(info.param).name; });

// Prints the table if docs/security.md does not contain it.
TEST(SecurityDocumentation, ListsTheAttacks) {
    std::string table;
    for (const Attack &attack : attacks) {
        std::string layers = attack.stopped_by & by_other_layers ? "system calls, limits, environment" : "";
        if (attack.stopped_by & by_namespaces)
            layers = attack.stopped_by & by_landlock ? "namespaces or Landlock" : "namespaces";
        table += std::string("| `") + attack.group + "` | " + attack.what + " | " + layers + " | `" +
                 name_of(attack) + "` |\n";
    }
    EXPECT_THAT(read_document("security.md"), HasSubstr(table));
}

// The plugin, a link to it, or a folder in LD_LIBRARY_PATH is in the home folder, beside a secret.
TEST(Sandbox, APluginInTheHomeFolderReadsOnlyItself) {
    if (!has("mount"))
        REQUIRE_LAYER("landlock");
    const fs::path library = arhost::test::test_plugin_directory() + "/hostile.so";
    for (const std::string where : {"itself", "link", "library path"}) {
        SCOPED_TRACE(where);
        HostileRun run("read");
        const fs::path home = run.target().parent_path(), plugin = home / "hostile.so";
        where == "itself" ? fs::copy(library, plugin) : fs::create_symlink(library, plugin);
        run.start({"--config", "run.yaml", "--set", "tracker.plugin=" + plugin.string()}, [&] {
            ::setenv("HOME", home.c_str(), 1);
            ::setenv("HOSTILE_FOLDER", home.c_str(), 1);
            if (where == "library path")
                ::setenv("LD_LIBRARY_PATH", home.c_str(), 1);
        });
        ASSERT_EQ(run.wait(), 0) << run.output();
        EXPECT_THAT(run.output(), HasSubstr("a file outside its list: stopped"));
        EXPECT_THAT(run.output(), Not(HasSubstr("SUCCEEDED")));
    }
}

// Without a layer that limits which files can be read, only arhost's own plugins run in mode standard.
TEST(Sandbox, StandardRunsOnlyOwnPluginsIfFilesCannotBeHidden) {
    REQUIRE_NO_SANITIZER();
    const Setting neither{"neither", false, false, false};
    HostileRun standard("none");
    standard.start_it(0, [&] { apply(neither); });
    EXPECT_EQ(standard.wait(), 2);
    EXPECT_THAT(standard.output(), HasSubstr("so only the plugins in"));
    HostileRun permissive("none", "", "sandbox: permissive\n");
    permissive.start_it(0, [&] { apply(neither); });
    EXPECT_EQ(permissive.wait(), 0) << permissive.output();
    ArhostRun own("version: 1\nsource: {plugin: source_synthetic, options: {frames: 2}}\n"
                  "outputs: [{plugin: sink_null}]\n");
    own.start({"--config", "run.yaml"}, [&] { apply(neither); });
    EXPECT_EQ(own.wait(), 0) << own.output();
}

TEST(Sandbox, ExplainsWhyUserNamespacesAreMissing) {
    REQUIRE_NO_SANITIZER();
    REQUIRE_ACCESS_OF_ORDINARY_USERS();
    const Setting setting{"", true, false, true};
    HostileRun run("none", "", "sandbox: strict\n");
    if (::geteuid() == 0)
        run.give_to(nobody);
    run.start_it(0, [&] { apply(setting); });
    EXPECT_EQ(run.wait(), 2);
    EXPECT_THAT(run.output(), HasSubstr("user: forbidden, for example by the container that arhost runs in"));
}

// A plugin with `processes` may signal its own processes. Only on machines without PID namespaces and Landlock
// version 6, it can signal others.
TEST(Sandbox, WithProcessesSignalsStayInsideTheWorker) {
    REQUIRE_NO_SANITIZER();
    REQUIRE_LAYER("seccomp");
    const bool confined = has("pid,") || has("signals");
    for (const char *attack : {"signal", "signal_by_child"}) {
        SCOPED_TRACE(attack);
        HostileRun run(attack, ", allow: [processes]");
        const Victim victim; // receives the signals instead of the host
        run.start_it(victim.pid());
        ASSERT_EQ(run.wait(), 0) << run.output();
        EXPECT_EQ(victim.lives(), confined) << run.output();
        const std::string call = attack == std::string("signal") ? ": kill: " : ": a child's kill: ";
        EXPECT_THAT(run.output(), HasSubstr(call + (confined ? "stopped" : "SUCCEEDED")));
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
    EXPECT_EQ(refused, !confined) << strict.output();
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

// In a user namespace, each worker has a limit of its own. Root has none.
TEST(Sandbox, LimitsThreadsOfOrdinaryUsers) {
    REQUIRE_NO_SANITIZER();
    REQUIRE_ACCESS_OF_ORDINARY_USERS();
    REQUIRE_LAYER("pid,");
    HostileRun run("threads");
    if (::geteuid() == 0)
        run.give_to(nobody);
    run.start_it(0, [] { apply({"", true, true, true}); });
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("a thousand threads: stopped"));
    expect_complete_video(run);
}

// The host must still be able to pass descriptors to a new worker.
TEST(Sandbox, LimitsDescriptors) {
    HostileRun run("descriptors");
    run.start_it();
    ASSERT_TRUE(run.wait_for_lines(attacked_frame + 5, "out/counted.txt")) << run.output();
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
    CountingRun run({.source = "frames: 5"});
    {
        const DescriptorsInFlight many;
        run.start({"check", "run.yaml"});
        // If this user has no limit, the loader does not wait, and the run ends.
        EXPECT_TRUE(eventually([&] {
            return !run.running() || std::ranges::any_of(run.workers(), [](pid_t pid) {
                return is_waiting_in(pid, "nanosleep") || waits_at_hidden_place(pid);
            });
        })) << run.output();
    }
    EXPECT_EQ(run.wait(), 0) << run.output();
}

TEST(Sandbox, ReportsATooSmallMemoryLimit) {
    REQUIRE_NO_SANITIZER();
    ArhostRun run(
        "version: 1\nsource: {plugin: source_synthetic}\n"
        "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}], memory_mb: 1}\n"
        "outputs: [{plugin: sink_null}]\n");
    run.expect(2, {"'memory_mb' may be too small"});
}

TEST(Sandbox, RejectsAMemoryLimitWithAGpu) {
    ArhostRun run("version: 1\nsource: {plugin: source_synthetic}\n"
                  "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}], "
                  "memory_mb: 100, allow: [gpu]}\n"
                  "outputs: [{plugin: sink_null}]\n");
    run.expect({"check", "run.yaml"}, 2,
               {"run.yaml:3:", "memory_mb: cannot be enforced together with 'allow: [gpu]'"});
}

// The plugin changes data between the host's check and use. This may result in a wrong pose, which cannot be
// detected.
TEST(Sandbox, SurvivesConcurrentChangesOfRingsAndSlots) {
    for (int i = 0; i < 3; ++i) {
        HostileRun run("race");
        const int status = run.attack();
        EXPECT_EQ(status, status_by_overlays(run)) << run.output();
        EXPECT_THAT(run.output(), HasSubstr("the race has started"));
        const auto lines = counted(run, "out/counted.txt");
        EXPECT_EQ(lines.size(), frames) << run.output();
        for (std::uint64_t i = 0; i < lines.size(); ++i)
            EXPECT_TRUE(lines[i].sequence == i && lines[i].video == i) << i;
    }
}

struct EndedAttack {
    const char *name, *what, *reason, *also = "";
    std::uint64_t unaugmented_before = 0; // frames before the attack that may have no overlay
};
constexpr EndedAttack ended_attacks[] = {
    // The plugin may erase its last result before the host has read it.
    {"scribble", "overwrites its rings, and makes its input writable", "violation: ", "make input writable: stopped",
     1},
    {"truncate", "truncates shared memory", "violation: ", "open and truncate: stopped", 1},
    {"doorbell", "floods the pipe that wakes the host", "floods its doorbell"},
    {"descriptor_in_message", "sends a descriptor", "protocol violation: it sent file descriptors"},
    {"large_messages", "floods its control channel with large messages",
     "protocol violation: it floods its control channel with messages"},
    {"small_messages", "floods its control channel with small messages",
     "protocol violation: it floods its control channel with messages"},
    {"deaf", "hangs and ignores every signal", "hung"},
    {"no_json", "sends text that is not JSON", ""},
    {"wrong_types", "sends a message whose fields have wrong types", ""},
    {"out_of_turn", "sends a valid message at the wrong time", ""},
    {"nested", "sends a message with 120,000 levels", ""},
};
void PrintTo(const EndedAttack &attack, std::ostream *stream) {
    *stream << attack.name;
}
class AWorkerIsEnded : public testing::TestWithParam<EndedAttack> {};

// "deaf" and "truncate" never answer. The host must notice each other attack before the deadline, also with
// sanitizers.
TEST_P(AWorkerIsEnded, AfterTheAttack) {
    const std::string name = GetParam().name;
    HostileRun run(name);
    const auto deadline = scaled(std::chrono::seconds(name == "deaf" || name == "truncate" ? 2 : 30));
    expect_ended(run, GetParam().reason, GetParam().unaugmented_before,
                 {"--set", "tracker.deadline_ms=" + std::to_string(deadline.count())});
    EXPECT_THAT(run.output(), HasSubstr(GetParam().also));
}

INSTANTIATE_TEST_SUITE_P(Sandbox, AWorkerIsEnded, testing::ValuesIn(ended_attacks),
                         [](const auto &info) { return info.param.name; });

// Prints the table if docs/security.md does not contain it.
TEST(SecurityDocumentation, ListsTheAttacksThatEndTheWorker) {
    std::string table;
    for (const EndedAttack &attack : ended_attacks)
        table += std::string("| ") + attack.what + " | `" + attack.name + "` |\n";
    EXPECT_THAT(read_document("security.md"), HasSubstr(table));
}

// "empty" has the effect of a closed channel; the socket rejects "oversized".
TEST(Sandbox, EmptyAndOversizedMessagesAreHarmless) {
    for (const char *attack : {"empty", "oversized"}) {
        HostileRun run(attack);
        const int status = run.attack();
        EXPECT_EQ(status, status_by_overlays(run)) << run.output();
        expect_complete_video(run);
    }
}

TEST(Sandbox, OneBudgetLimitsTheLinesOfAWorker) {
    for (const char *attack : {"failures", "lines"}) {
        SCOPED_TRACE(attack);
        HostileRun run(attack);
        run.start_it(0, [] {}, {"-v"});
        ASSERT_EQ(run.wait(), 0);
        const std::string output = run.output();
        EXPECT_LT(std::count(output.begin(), output.end(), '\n'), 400);
        EXPECT_EQ(run.stats()["restarts"]["tracker"], 0);
        expect_complete_video(run);
    }
}

// The tracker prints 32 MiB in one frame.
TEST(Sandbox, AFloodOfOutputIsDiscardedWithOneWarning) {
    HostileRun run("output");
    run.start_it(0, [] {}, {"--set", "tracker.deadline_ms=60000"});
    ASSERT_EQ(run.wait(), 0) << run.output();
    const std::string output = run.output(), warning = "prints more than arhost logs";
    EXPECT_THAT(output, ContainsRegex("warning: tracker: it " + warning + ".*print less"));
    EXPECT_EQ(output.find(warning), output.rfind(warning));
    EXPECT_THAT(output, ContainsRegex("tracker: discarded [0-9]+ MB of what it printed"));
    EXPECT_EQ(run.stats()["restarts"]["tracker"], 0);
    expect_complete_video(run);
}

TEST(Sandbox, TheLastLineBeforeACrashIsReportedAfterMuchOutput) {
    HostileRun run("burst", "", "restart: {first_delay_ms: 1, quarantine_after: 2}\n");
    run.attack();
    const auto crashes = run.stats()["crashes"];
    ASSERT_GE(crashes.size(), 1u) << run.output();
    for (const auto &crash : crashes)
        EXPECT_THAT(crash["log_tail"].get<std::string>(), testing::EndsWith("the reason of the crash\n"));
}

// Each process of the plugin sends a message of an unknown type, whose name has 120 KB.
TEST(Sandbox, DeathsDoNotLogLongTextsOfTheWorker) {
    HostileRun run("huge_type");
    expect_ended(run, "protocol violation: unexpected message \"xxx");
    EXPECT_GE(run.stats()["restarts"]["tracker"], 20);
    EXPECT_LT(run.output().size(), 500'000u);
    EXPECT_LT(run.read("stats.json").size(), 500'000u);
}

TEST(Sandbox, RefusesAnImplausibleLens) {
    ArhostRun run("version: 1\nsource: {plugin: hostile_source, options: {attack: lens}}\n"
                  "tracker: {plugin: tracker_counter, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}\n"
                  "raytracer: {plugin: rt_counter, scene: scene.yaml}\noutputs: [{plugin: sink_null}]\n");
    run.write("scene.yaml", small_scene);
    run.expect(2, {"run.yaml:2:", "the lens distortion is implausible: near the principal point it scales "
                                  "distances by "});
}

TEST(Sandbox, ASecondHelloEndsTheWorker) {
    HostileRun run("second_hello", "", "restart: {first_delay_ms: 1, quarantine_after: 2}\n");
    EXPECT_NE(run.attack(), 0);
    EXPECT_THAT(run.output(), HasSubstr("protocol violation: unexpected message \"hello\""));
}

// A stop that reports progress forever must not outlast a signal to the host by more than stop_deadline_ms. The
// deadline of `record`, which no command has started, does not count.
TEST(Sandbox, OneSignalEndsARunWhosePluginStopsForever) {
    const std::string deadline_ms = std::to_string(scaled(std::chrono::seconds(1)).count());
    ArhostRun run("version: 1\nsource: {plugin: hostile_source, stop_deadline_ms: " + deadline_ms +
                  ", options: {frames: 20, attack: endless_stop}}\n"
                  "outputs: [{plugin: sink_poses, path: poses.jsonl, stop_deadline_ms: " +
                  deadline_ms + "}]\nrecord: {plugin: sink_poses, path: take.jsonl, stop_deadline_ms: 3600000}\n");
    run.start();
    ASSERT_TRUE(run.wait_for_lines(20, "poses.jsonl")) << run.output();
    send_signal(run.pid(), SIGTERM);
    EXPECT_EQ(run.wait(), 1) << run.output();
    EXPECT_THAT(run.output(),
                HasSubstr("not stopped within " + deadline_ms + " ms after the signal (stop_deadline_ms): source; "));
    EXPECT_EQ(run.lines("poses.jsonl"), 20u);
}

TEST(Sandbox, DescriptorFlagsDoNotBlockTheHost) {
    HostileRun run("flags");
    expect_stopped(run);
}

// A plugin must not be able to redirect or block the host's own output files, even if it may write to their folder.
TEST(Sandbox, HostDoesNotOpenPlantedLinksOrPipes) {
    for (const char *attack : {"link", "pipe"}) {
        SCOPED_TRACE(attack);
        HostileRun run(attack, "", "timeline: times.csv\nsandbox: none\n");
        ASSERT_EQ(run.attack(), 0) << run.output();
        EXPECT_THAT(run.output(), HasSubstr("SUCCEEDED"));
        EXPECT_EQ(run.target_text(), "secret");
        EXPECT_EQ(run.stats()["frames"]["in"], frames);
        EXPECT_THAT(run.read("times.csv"), testing::StartsWith("frame,"));
        for (const char *report : {"stats.json", "times.csv"})
            EXPECT_EQ(fs::symlink_status(run.path(report)).type(), fs::file_type::regular) << report;
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
    if (level().find("MISSING") != std::string::npos) {
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
    run.expect(2, {"run.yaml:2", "'source_v4l2' needs 'video', which the sandbox blocks: add 'allow: "
                                 "[video]' to source"});
    run.expect({"--config", "run.yaml", "--set", "source.allow=[video]"}, 2, {"/dev/none"});
    run.expect({"--config", "run.yaml", "--set", "sandbox=none"}, 2, {"/dev/none"});
}

TEST(Sandbox, WarnsIfAnOutputMayWriteToTheWorkingDirectory) {
    CountingRun run({.source = "frames: 3"});
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_THAT(run.output(),
                HasSubstr("run.yaml:6:40: outputs[0].path: 'sink_counter' may write to everything in and below '"));
    ASSERT_EQ(run.run({"--config", "run.yaml", "--set", "outputs[0].path=out/counted.txt"}), 0) << run.output();
    EXPECT_THAT(run.output(), Not(HasSubstr("may write to everything")));
}

TEST(Sandbox, ReadsGrantsALibraryInAnotherFolder) {
    if (!has("mount"))
        REQUIRE_LAYER("landlock");
    ArhostRun run;
    run.run({"plugins", "linked_elsewhere"});
    EXPECT_THAT(run.output(), ContainsRegex("linked_elsewhere +cannot be used: .*cannot open shared object file.*"
                                            "'--reads FOLDER' to plugins and conform"));
    run.run({"plugins", "linked_elsewhere", "--reads", arhost::test::build_directory() + "/tests/elsewhere"});
    EXPECT_THAT(run.output(), ContainsRegex("linked_elsewhere +cannot be used: .*exports no symbol 'arhost_entry'"));
    run.expect({"plugins", "--reads", "/"}, 2, {"the sandbox cannot grant '/'"});
}

TEST(Sandbox, RejectsUnknownPermissions) {
    HostileRun run("none", ", allow: [vidoe]");
    EXPECT_EQ(run.attack(), 2);
    EXPECT_THAT(run.output(), HasSubstr("tracker.allow[0]"));
    EXPECT_THAT(run.output(), HasSubstr("video"));
}
