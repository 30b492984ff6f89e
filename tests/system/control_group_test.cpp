// SPDX-License-Identifier: Apache-2.0
//
// Workers in control groups. Needs root and a cgroup v2 hierarchy with the controllers cpu, memory and pids, which
// containers seldom have; CMakeLists.txt runs these tests in a virtual machine.
#include "arhost_run.hpp"

#include <gmock/gmock.h>

#include <grp.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/xattr.h>

using namespace arhost::test;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::UnorderedElementsAre;
namespace fs = std::filesystem;

namespace {

constexpr uid_t nobody = 65534;
const fs::path hierarchy = "/sys/fs/cgroup";

bool write(const fs::path &file, const std::string &text) {
    return static_cast<bool>(std::ofstream(file) << text << std::flush);
}

std::string first_line(const fs::path &file) {
    std::string line;
    std::ifstream stream(file);
    std::getline(stream, line);
    return line;
}

std::set<pid_t> processes_of(const fs::path &group) {
    std::ifstream file(group / "cgroup.procs");
    return {std::istream_iterator<pid_t>(file), {}};
}

// A control group as an administrator, a container or systemd delegates it.
class Delegated : public testing::Test {
protected:
    void SetUp() override {
        if (::geteuid() != 0)
            GTEST_SKIP() << "needs root";
        if (!fs::exists(hierarchy / "cgroup.procs"))
            ::mount("cgroup2", hierarchy.c_str(), "cgroup2", 0, nullptr);
        write(hierarchy / "cgroup.subtree_control", "+cpu +memory +pids");
        const std::string controllers = first_line(hierarchy / "cgroup.subtree_control");
        for (const char *controller : {"cpu", "memory", "pids"})
            if (controllers.find(controller) == std::string::npos)
                GTEST_SKIP() << "this machine has no cgroup v2 hierarchy with the controller " << controller;
        ASSERT_TRUE(fs::create_directory(group_));
    }
    void TearDown() override {
        if (fs::exists(group_)) {
            write(group_ / "cgroup.kill", "1");
            EXPECT_TRUE(eventually([this] { return ::rmdir(group_.c_str()) == 0; }));
        }
    }
    // Starts arhost in the group, as an ordinary user that owns it, or as root.
    void start(ArhostRun &run, bool is_root = false, const std::vector<std::string> &more = {}) {
        std::vector<std::string> arguments = {"run.yaml"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        if (is_root)
            ::setxattr(group_.c_str(), "user.delegate", "1", 1, 0);
        else
            for (const fs::path &path : {run.path("."), group_, group_ / "cgroup.procs",
                                         group_ / "cgroup.subtree_control", group_ / "cgroup.threads"})
                ASSERT_EQ(::chown(path.c_str(), nobody, nobody), 0);
        run.start(arguments, [&] {
            if (!write(group_ / "cgroup.procs", "0") ||
                (!is_root && (::setgroups(0, nullptr) != 0 || ::setgid(nobody) != 0 || ::setuid(nobody) != 0)))
                ::_exit(125);
        });
    }
    // Everything is as before the run.
    void expect_restored() const {
        std::vector<fs::path> subgroups;
        for (const auto &entry : fs::directory_iterator(group_))
            if (entry.is_directory())
                subgroups.push_back(entry.path().filename());
        EXPECT_THAT(subgroups, IsEmpty());
        EXPECT_EQ(first_line(group_ / "cgroup.subtree_control"), "");
        EXPECT_THAT(processes_of(group_), IsEmpty());
    }

    const fs::path group_ = hierarchy / "arhost-test";
};

std::string attacked_by(const std::string &attack, const std::string &more = "", const std::string &settings = "") {
    return "version: 1\nsource: {plugin: hostile_source, deadline_ms: 60000, options: {frames: 40, attack: " +
           attack + "}" + more + "}\noutputs: [{plugin: sink_null}]\nstats: stats.json\n" + settings;
}

} // namespace

// Page tables are no private memory, so RLIMIT_DATA does not count them, and RLIMIT_AS counts those of one process.
TEST_F(Delegated, GroupLimitsPageTables) {
    ArhostRun run(
        attacked_by("page_tables", ", memory_mb: 64, allow: [processes]", "restart: {quarantine_after: 1}\n"));
    start(run);
    EXPECT_NE(run.wait(), 0);
    EXPECT_THAT(run.output(), HasSubstr("it used more memory than its control group allows"));
    EXPECT_THAT(run.output(), Not(HasSubstr("page tables: ")));
    expect_restored();
}

// RLIMIT_NPROC does not limit root.
TEST_F(Delegated, GroupLimitsThreadsOfRoot) {
    ArhostRun run(attacked_by("threads"));
    start(run, true, {"-v"});
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), ContainsRegex("threads: [0-9]+"));
    EXPECT_THAT(run.output(), Not(HasSubstr("threads: 2000")));
    expect_restored();
}

TEST_F(Delegated, GroupPrefersTheHostAndHoldsTheWorkers) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 0, delay_ms: 10}}\n"
                  "outputs: [{plugin: sink_null}]\n");
    start(run);
    const pid_t worker = run.wait_for_worker("sink_null");
    ASSERT_NE(worker, 0) << run.output();
    EXPECT_THAT(processes_of(group_ / "arhost-host"), UnorderedElementsAre(run.pid(), run.launcher()));
    EXPECT_EQ(first_line(group_ / "arhost-host/cpu.weight"), "1000");
    const std::string own = first_line("/proc/" + std::to_string(worker) + "/cgroup");
    EXPECT_THAT(own, HasSubstr("/arhost-test/arhost-worker-"));
    const fs::path group = group_ / fs::path(own).filename();
    EXPECT_EQ(first_line(group / "cpu.weight"), "100");
    EXPECT_THAT(processes_of(group), testing::Contains(worker));
    EXPECT_EQ(processes_of(group).size(), 2u); // with PID 1 of its namespace
    send_signal(run.pid(), SIGINT);
    run.wait();
    expect_restored();
}

// The processes have left their session. Without a PID namespace, only the group knows them.
TEST_F(Delegated, GroupEndsTheProcessesOfItsWorker) {
    ArhostRun run(attacked_by("processes", ", allow: [processes]"));
    start(run, false, {"-v"});
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("processes: 3"));
    expect_restored();
}

TEST_F(Delegated, GroupIsUsedByTheNextLauncher) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 0, delay_ms: 10}}\n"
                  "outputs: [{plugin: sink_null}]\n");
    start(run);
    ASSERT_NE(run.wait_for_worker("sink_null"), 0) << run.output();
    const pid_t killed = run.launcher();
    send_signal(killed, SIGKILL);
    EXPECT_TRUE(run.eventually([&] { return run.launcher() != killed; }));
    const pid_t worker = run.wait_for_worker("sink_null");
    EXPECT_THAT(first_line("/proc/" + std::to_string(worker) + "/cgroup"), HasSubstr("/arhost-test/arhost-worker-"));
    send_signal(run.pid(), SIGINT);
    run.wait();
    expect_restored();
}

// A worker group of a killed launcher cannot be removed while it has processes.
TEST_F(Delegated, GroupMayContainLeftOverGroups) {
    ASSERT_TRUE(fs::create_directory(group_ / "arhost-worker-1"));
    ArhostRun run(attacked_by("none"));
    start(run, false, {"-v"});
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("control group: kill, memory.max"));
    fs::remove(group_ / "arhost-worker-1");
    expect_restored();
}

// In a container, the topmost visible group is the container's.
TEST_F(Delegated, GroupMayBeTheTopmostOfAContainer) {
    ArhostRun run(attacked_by("none"));
    run.start({"run.yaml", "-v"}, [&] {
        if (!write(group_ / "cgroup.procs", "0") || ::unshare(CLONE_NEWCGROUP | CLONE_NEWNS) != 0 ||
            ::mount("", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
            ::umount2(hierarchy.c_str(), MNT_DETACH) != 0 ||
            ::mount("cgroup2", hierarchy.c_str(), "cgroup2", 0, nullptr) != 0)
            ::_exit(125);
    });
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("control group: kill, memory.max"));
    expect_restored();
}

// The launcher must not move processes that it does not know.
TEST_F(Delegated, GroupWithOtherProcessesIsNotUsed) {
    const pid_t other = ::fork();
    if (other == 0)
        for (;;)
            ::pause();
    ASSERT_TRUE(write(group_ / "cgroup.procs", std::to_string(other)));
    ArhostRun run(attacked_by("none"));
    start(run);
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(processes_of(group_), UnorderedElementsAre(other));
    ::kill(other, SIGKILL);
    ::waitpid(other, nullptr, 0);
    expect_restored();
}

TEST_F(Delegated, GroupIsReported) {
    ArhostRun run(attacked_by("none"));
    start(run, false, {"-v"});
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("control group: kill, memory.max, pids.max, cpu.weight"));
}

// Root may write to all groups, but the groups that systemd has not delegated belong to systemd.
TEST_F(Delegated, OnlyADelegatedGroupIsUsedByRoot) {
    ArhostRun run(attacked_by("none"));
    run.start({"run.yaml", "-v"}, [&] {
        if (!write(group_ / "cgroup.procs", "0"))
            ::_exit(125);
    });
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("control group: none"));
    expect_restored();
}
