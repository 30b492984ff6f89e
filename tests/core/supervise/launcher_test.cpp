// SPDX-License-Identifier: Apache-2.0
#include "supervise/launcher.hpp"

#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <poll.h>
#include <sys/wait.h>

using namespace arhost::supervise;

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

} // namespace

TEST(Launcher, ReportsHowAProcessEnded) {
    Launcher launcher;
    const Spawned spawned = launcher.spawn("/bin/true");
    wait_dead(spawned);
    const Exit exit = launcher.wait_exit(spawned.pid);
    EXPECT_TRUE(WIFEXITED(exit.wait_status));
    EXPECT_EQ(WEXITSTATUS(exit.wait_status), 0);
    EXPECT_GE(exit.cpu_seconds, 0.0);
}

TEST(Launcher, KeepsTheExitsOfSeveralApart) {
    Launcher launcher;
    const Spawned good = launcher.spawn("/bin/true"), bad = launcher.spawn("/bin/false");
    wait_dead(good);
    wait_dead(bad);
    EXPECT_EQ(WEXITSTATUS(launcher.wait_exit(bad.pid).wait_status), 1);
    EXPECT_EQ(WEXITSTATUS(launcher.wait_exit(good.pid).wait_status), 0);
}

TEST(Launcher, SaysSoWhereTheProgramIsMissing) {
    Launcher launcher;
    const Spawned spawned = launcher.spawn("/no/such/program");
    wait_dead(spawned);
    EXPECT_EQ(WEXITSTATUS(launcher.wait_exit(spawned.pid).wait_status), 127);
    EXPECT_NE(all_output(spawned).find("can't be executed"), std::string::npos);
}

TEST(Launcher, HasAnotherThatStandsBy) {
    Launcher launcher;
    const Spawned first = launcher.spawn("/usr/bin/yes");
    std::ifstream status("/proc/" + std::to_string(first.pid) + "/status");
    pid_t parent = 0;
    for (std::string key; status >> key && key != "PPid:";) {
    }
    status >> parent;
    ::kill(parent, SIGKILL);
    wait_dead(first);
    const Spawned second = launcher.spawn("/bin/true");
    EXPECT_EQ(WTERMSIG(launcher.wait_exit(first.pid).wait_status), SIGKILL);
    wait_dead(second);
    EXPECT_EQ(WEXITSTATUS(launcher.wait_exit(second.pid).wait_status), 0);
}

TEST(Launcher, TakesItsChildrenAlongWhenItEnds) {
    Spawned spawned;
    {
        Launcher launcher;
        spawned = launcher.spawn("/bin/cat"); // stdin is /dev/null, but descriptors 3 and 4 are ours
        spawned = launcher.spawn("/usr/bin/yes");
    }
    wait_dead(spawned);
}
