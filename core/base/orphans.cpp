// SPDX-License-Identifier: Apache-2.0
#include "base/orphans.hpp"

#include <csignal>
#include <fstream>
#include <iterator>
#include <sys/wait.h>
#include <unistd.h>

namespace arhost::base {

std::set<pid_t> children() {
    std::ifstream file("/proc/thread-self/children");
    return {std::istream_iterator<pid_t>(file), {}};
}

int kill_orphans(const std::set<pid_t> &kept) {
    int count = 0;
    for (const pid_t child : children()) {
        siginfo_t info{}; // fails if /proc belongs to another PID namespace, where `child` is another process
        if (!kept.contains(child) &&
            ::waitid(P_PID, static_cast<id_t>(child), &info, WEXITED | WNOHANG | WNOWAIT) == 0) {
            ::kill(child, SIGKILL);
            ::waitpid(child, nullptr, WNOHANG); // if it has not exited yet, a later call reaps it
            ++count;
        }
    }
    return count;
}

bool end_orphans(const std::set<pid_t> &kept) {
    for (int i = 0; i < 500; ++i) {
        if (kill_orphans(kept) == 0)
            return true;
        ::usleep(1000);
    }
    return false;
}

} // namespace arhost::base
