// SPDX-License-Identifier: Apache-2.0
#include "supervise/launcher.hpp"

#include "errors.hpp"
#include "plugin_under_test.hpp"
#include "processes.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <csignal>
#include <fstream>
#include <poll.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/wait.h>

using namespace arhost::supervise;
using namespace arhost::test;

namespace {

void wait_dead(const Spawned &spawned) {
    pollfd ready{spawned.pidfd.get(), POLLIN, 0};
    ASSERT_EQ(::poll(&ready, 1, 20'000), 1);
}

std::string all_output(const Spawned &spawned) {
    std::string text;
    char bytes[512];
    for (ssize_t count; (count = ::read(spawned.output.get(), bytes, sizeof bytes)) > 0;)
        text.append(bytes, static_cast<std::size_t>(count));
    return text;
}

const std::string program = arhost::test::build_directory() + "/bin/arhost-launcher";
const LogFunction no_log = [](arhost_severity, const std::string &, const std::string &) {};

pid_t parent_of(pid_t pid) {
    return std::atoi(status_of(pid, "PPid").c_str());
}

// Returns the process's pid in its own PID namespace.
pid_t innermost_pid(pid_t pid) {
    const std::string pids = status_of(pid, "NSpid");
    return std::atoi(pids.substr(pids.rfind('\t') + 1).c_str());
}

// Returns the child of `parent` that is PID 1 of a namespace; 0 if there is none.
pid_t init_started_by(pid_t parent) {
    const std::string id = std::to_string(parent);
    std::ifstream children("/proc/" + id + "/task/" + id + "/children");
    for (pid_t child; children >> child;)
        if (innermost_pid(child) == 1)
            return child;
    return 0;
}

std::string spawn_error(Launcher &launcher) {
    return error_of<std::runtime_error>([&] { launcher.spawn("/bin/true", Isolation{false}, no_log); });
}

} // namespace

TEST(Launcher, ReportsTheExitOfAProcess) {
    Launcher launcher(program);
    const Spawned spawned = launcher.spawn("/bin/true", Isolation{}, no_log);
    wait_dead(spawned);
    const Exit exit = launcher.wait_exit(spawned.pid);
    EXPECT_TRUE(WIFEXITED(exit.wait_status));
    EXPECT_EQ(WEXITSTATUS(exit.wait_status), 0);
    EXPECT_GE(exit.cpu_seconds, 0.0);
}

TEST(Launcher, DistinguishesTheExitsOfSeveralProcesses) {
    Launcher launcher(program);
    const Spawned good = launcher.spawn("/bin/true", Isolation{}, no_log),
                  bad = launcher.spawn("/bin/false", Isolation{}, no_log);
    wait_dead(good);
    wait_dead(bad);
    EXPECT_EQ(WEXITSTATUS(launcher.wait_exit(bad.pid).wait_status), 1);
    EXPECT_EQ(WEXITSTATUS(launcher.wait_exit(good.pid).wait_status), 0);
}

TEST(Launcher, ReportsAMissingProgram) {
    Launcher launcher(program);
    const Spawned spawned = launcher.spawn("/no/such/program", Isolation{}, no_log);
    wait_dead(spawned);
    EXPECT_EQ(WEXITSTATUS(launcher.wait_exit(spawned.pid).wait_status), 127);
    EXPECT_NE(all_output(spawned).find("cannot be executed"), std::string::npos);
}

TEST(Launcher, IsReplacedEachTimeItIsKilled) {
    Launcher launcher(program);
    std::string log;
    const LogFunction note = [&](arhost_severity, const std::string &, const std::string &text) {
        log += text + '\n';
    };
    Spawned first = launcher.spawn("/usr/bin/yes", Isolation{}, note);
    for (int i = 0; i < 3; ++i) {
        EXPECT_EQ(log, "");
        ::kill(parent_of(first.pid), SIGKILL);
        wait_dead(first);
        const pid_t pid = first.pid;
        first = launcher.spawn("/usr/bin/yes", Isolation{}, note);
        EXPECT_EQ(WTERMSIG(launcher.wait_exit(pid).wait_status), SIGKILL);
        EXPECT_EQ(log, "the launcher has died, and all workers with it; starting a new one\n");
        log.clear();
    }
    const Spawned last = launcher.spawn("/bin/true", Isolation{}, note);
    wait_dead(last);
    EXPECT_EQ(WEXITSTATUS(launcher.wait_exit(last.pid).wait_status), 0);
}

TEST(Launcher, DoesNotKillUnrelatedChildrenWhenItIsReplaced) {
    const pid_t other = ::fork(); // like a child of a shell that then started this program with exec
    if (other == 0)
        for (;;)
            ::pause();
    Launcher launcher(program);
    const Spawned first = launcher.spawn("/usr/bin/yes", Isolation{}, no_log);
    ::kill(parent_of(first.pid), SIGKILL);
    wait_dead(first);
    launcher.spawn("/usr/bin/yes", Isolation{}, no_log);
    EXPECT_EQ(::waitpid(other, nullptr, WNOHANG), 0) << "the unrelated child was killed";
    ::kill(other, SIGKILL);
    ::waitpid(other, nullptr, 0);
}

TEST(Launcher, StartsAWorkerAsPid2WhosePid1EndsWithIt) {
    Launcher launcher(program);
    const Spawned worker = launcher.spawn("/usr/bin/yes", Isolation{}, no_log);
    if (innermost_pid(worker.pid) == worker.pid)
        GTEST_SKIP() << "this machine does not allow PID namespaces";
    EXPECT_EQ(innermost_pid(worker.pid), 2);
    const pid_t init = init_started_by(parent_of(worker.pid));
    ASSERT_GT(init, 0);
    ::kill(worker.pid, SIGKILL);
    launcher.wait_exit(worker.pid);
    EXPECT_TRUE(eventually([&] { return !is_alive(init); }));
}

TEST(Launcher, ReportsThatItCanNotStartAProcess) {
    Launcher launcher(program);
    const Spawned first = launcher.spawn("/usr/bin/yes", Isolation{false}, no_log);
    const pid_t pid = parent_of(first.pid);
    wait_asleep(pid); // it has then closed the descriptors of the request
    const std::filesystem::directory_iterator open_files("/proc/" + std::to_string(pid) + "/fd"), end;
    rlimit usual{};
    ASSERT_EQ(::prlimit(pid, RLIMIT_NOFILE, nullptr, &usual), 0);
    // Enough for the three descriptors of the request, but not for the worker's pidfd.
    const rlimit few{static_cast<rlim_t>(std::distance(open_files, end)) + 3, usual.rlim_max};
    ASSERT_EQ(::prlimit(pid, RLIMIT_NOFILE, &few, nullptr), 0);
    EXPECT_EQ(spawn_error(launcher), "no process can be started: Too many open files");
    ASSERT_EQ(::prlimit(pid, RLIMIT_NOFILE, &usual, nullptr), 0);
    EXPECT_EQ(spawn_error(launcher), "no error");
    EXPECT_TRUE(is_alive(first.pid)) << "the launcher was replaced";
}

TEST(Launcher, ReportsThatItsHostHasNoFreeDescriptors) {
    Launcher launcher(program);
    ASSERT_EQ(spawn_error(launcher), "no error");
    rlimit usual{};
    ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &usual), 0);
    const int unused = ::dup(STDIN_FILENO);
    ::close(unused);
    std::vector<std::string> errors;
    for (int free = 0; free < 20; ++free) {
        const rlimit few{static_cast<rlim_t>(unused + free), usual.rlim_max};
        ::setrlimit(RLIMIT_NOFILE, &few);
        const std::string error = spawn_error(launcher);
        ::setrlimit(RLIMIT_NOFILE, &usual);
        if (error == "no error")
            break;
        errors.push_back(error);
    }
    EXPECT_THAT(errors, testing::Each(testing::HasSubstr("Too many open files")));
    EXPECT_THAT(errors, testing::Contains("no process can be started: Too many open files"));
    EXPECT_LT(errors.size(), 20u);
}

TEST(Launcher, ReportsThatItCanNotBeStarted) {
    const auto reason = [](const char *wrong) {
        return error_of<std::runtime_error>([&] { Launcher(wrong).spawn("/bin/true", Isolation{}, no_log); });
    };
    EXPECT_EQ(reason("/no/such/program"), "/no/such/program cannot be started: No such file or directory; is it "
                                          "installed in the same folder as arhost?");
    EXPECT_EQ(reason("/bin/true"),
              "no process can be started: /bin/true was started 5 times and exited or did not respond each time");
}

// A launcher under a debugger does not respond, and the debugger collects its exit status before this process can.
TEST(Launcher, IsReplacedIfADebuggerHoldsIt) {
    Launcher launcher(program, std::chrono::milliseconds(500));
    const Spawned first = launcher.spawn("/usr/bin/yes", Isolation{}, no_log);
    const pid_t held = parent_of(first.pid);
    int ends[2];
    ASSERT_EQ(::pipe(ends), 0);
    const pid_t debugger = ::fork();
    if (debugger == 0) {
        const char holds = ::ptrace(PTRACE_SEIZE, held, nullptr, nullptr) == 0 &&
                           ::ptrace(PTRACE_INTERRUPT, held, nullptr, nullptr) == 0;
        (void)!::write(ends[1], &holds, 1);
        for (;;)
            ::pause();
    }
    char holds = 0;
    ASSERT_EQ(::read(ends[0], &holds, 1), 1);
    if (holds) {
        const Spawned second = launcher.spawn("/bin/true", Isolation{}, no_log);
        wait_dead(second);
        EXPECT_EQ(WEXITSTATUS(launcher.wait_exit(second.pid).wait_status), 0);
        EXPECT_FALSE(is_alive(first.pid));
    }
    ::kill(debugger, SIGKILL);
    ::waitpid(debugger, nullptr, 0);
    ::close(ends[0]);
    ::close(ends[1]);
    if (!holds)
        GTEST_SKIP() << "ptrace is not permitted on this machine";
}

TEST(Launcher, IsReplacedIfItDoesNotRespond) {
    const arhost::test::ScratchFolder scratch;
    const std::string silent = scratch.path() / "silent";
    std::ofstream(silent) << "#!/bin/sh\nif mkdir " << silent << ".once; then sleep 1000 & echo $! > " << silent
                          << ".pid; wait; fi\nexec " << program << "\n";
    std::filesystem::permissions(silent, std::filesystem::perms::owner_all);
    Launcher launcher(silent, std::chrono::seconds(2));
    const Spawned spawned = launcher.spawn("/bin/true", Isolation{}, no_log);
    wait_dead(spawned);
    EXPECT_EQ(WEXITSTATUS(launcher.wait_exit(spawned.pid).wait_status), 0);
    pid_t child = 0;
    std::ifstream(silent + ".pid") >> child;
    EXPECT_GT(child, 0);
    EXPECT_FALSE(is_alive(child)) << "its child process survived";
}

TEST(Launcher, DoesNotBlockTheDestructorIfItDoesNotExit) {
    const arhost::test::ScratchFolder scratch;
    const std::string silent = scratch.path() / "silent";
    std::ofstream(silent) << "#!/bin/sh\necho $$ > " << silent << ".pid\n" << program << "\nexec sleep 1000\n";
    std::filesystem::permissions(silent, std::filesystem::perms::owner_all);
    {
        Launcher launcher(silent, std::chrono::milliseconds(500));
        wait_dead(launcher.spawn("/bin/true", Isolation{}, no_log));
    }
    pid_t pid = 0;
    std::ifstream(silent + ".pid") >> pid;
    EXPECT_GT(pid, 0);
    EXPECT_FALSE(is_alive(pid));
}

// PR_SET_PDEATHSIG sends SIGCONT to the stopped launcher, which then continues and kills the workers.
TEST(Launcher, ExitsWithItsHostEvenIfStopped) {
    int ends[2];
    ASSERT_EQ(::pipe(ends), 0);
    const pid_t host = ::fork();
    if (host == 0) {
        Launcher launcher(program);
        const Spawned worker = launcher.spawn("/usr/bin/yes", Isolation{}, no_log);
        const pid_t pids[] = {worker.pid, parent_of(worker.pid)};
        ::kill(pids[1], SIGSTOP);
        ::kill(worker.pid, SIGSTOP);
        (void)!::write(ends[1], pids, sizeof pids);
        ::raise(SIGKILL);
    }
    pid_t pids[2] = {};
    ASSERT_EQ(::read(ends[0], pids, sizeof pids), static_cast<ssize_t>(sizeof pids));
    ::waitpid(host, nullptr, 0);
    for (const pid_t pid : pids) {
        EXPECT_TRUE(eventually([&] { return !is_alive(pid); }));
        ::kill(pid, SIGKILL);
    }
    ::close(ends[0]);
    ::close(ends[1]);
}

TEST(Launcher, KillsItsChildrenWhenItExits) {
    Spawned spawned;
    {
        Launcher launcher(program);
        spawned = launcher.spawn("/bin/cat", Isolation{}, no_log);
        spawned = launcher.spawn("/usr/bin/yes", Isolation{}, no_log);
    }
    wait_dead(spawned);
}
