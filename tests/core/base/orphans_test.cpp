// SPDX-License-Identifier: Apache-2.0
#include "base/orphans.hpp"
#include "processes.hpp"

#include <gtest/gtest.h>

#include <csignal>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

using namespace arhost::base;
using arhost::test::is_alive;

namespace {

pid_t sleeper() {
    const pid_t pid = ::fork();
    for (; pid == 0;)
        ::pause();
    return pid;
}

} // namespace

TEST(Orphans, AreKilledExceptKeptOnes) {
    ::prctl(PR_SET_CHILD_SUBREAPER, 1);
    const pid_t kept = sleeper(), other = sleeper();
    int ends[2];
    ASSERT_EQ(::pipe(ends), 0);
    if (const pid_t parent = ::fork(); parent == 0) { // its child becomes a child of this process
        const pid_t left = sleeper();
        (void)!::write(ends[1], &left, sizeof left);
        ::_exit(0);
    }
    pid_t left = 0;
    ASSERT_EQ(::read(ends[0], &left, sizeof left), static_cast<ssize_t>(sizeof left));
    EXPECT_TRUE(children().contains(kept));
    end_orphans({kept});
    EXPECT_TRUE(is_alive(kept));
    EXPECT_FALSE(is_alive(other));
    EXPECT_FALSE(is_alive(left));
    EXPECT_EQ(kill_orphans({kept}), 0);
    ::kill(kept, SIGKILL);
    ::waitpid(kept, nullptr, 0);
    ::close(ends[0]);
    ::close(ends[1]);
}
