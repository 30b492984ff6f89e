// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <sys/types.h>
#include <unistd.h>

namespace arhost::test {

// Returns a value in the status of a process or thread, as /proc shows it; "" if it does not exist.
inline std::string status_of(pid_t id, const std::string &key) {
    std::ifstream status("/proc/" + std::to_string(id) + "/status");
    for (std::string line; std::getline(status, line);)
        if (line.starts_with(key + ":\t"))
            return line.substr(key.size() + 2);
    return "";
}

// Returns whether a process is running. Returns false for a zombie, which may remain forever if there is no init
// process to reap it.
inline bool is_alive(pid_t pid) {
    const std::string state = status_of(pid, "State");
    return !state.empty() && state[0] != 'Z' && state[0] != 'X';
}

// Polls a condition. Returns false if it does not become true within 20 s.
template <class Condition> bool becomes_true(const Condition &condition) {
    for (int i = 0; i < 10'000 && !condition(); ++i)
        ::usleep(2000);
    return condition();
}

// Waits until a process or thread sleeps.
inline void wait_asleep(pid_t id) {
    EXPECT_TRUE(becomes_true([id] { return status_of(id, "State").starts_with("S"); }));
}

} // namespace arhost::test
