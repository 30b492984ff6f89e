// SPDX-License-Identifier: Apache-2.0
//
// Other processes and threads, as /proc shows them.
#pragma once

#include "waiting.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <string>
#include <sys/types.h>

namespace arhost::test {

// Returns a value in the status of a process or thread; "" if it does not exist.
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

// Waits until a process or thread sleeps.
inline void wait_asleep(pid_t id) {
    EXPECT_TRUE(eventually([id] { return status_of(id, "State").starts_with("S"); }));
}

// Returns how often a process has waited for something, such as a frame, so far.
inline std::uint64_t waits_of(pid_t pid) {
    const std::string count = status_of(pid, "voluntary_ctxt_switches");
    return count.empty() ? 0 : std::stoull(count);
}

// Returns whether a process waits in a function of the kernel, such as "pipe_write". Always false if the kernel does
// not show this user where the process waits.
inline bool is_waiting_in(pid_t pid, const std::string &function) {
    std::ifstream file("/proc/" + std::to_string(pid) + "/wchan");
    std::string name;
    return file >> name && name.find(function) != std::string::npos;
}

// Returns whether a process waits and the kernel does not show this user where.
inline bool waits_at_hidden_place(pid_t pid) {
    const std::uint64_t waits = waits_of(pid);
    const auto is_asleep = [&] { return status_of(pid, "State").starts_with("S") && waits_of(pid) == waits; };
    if (!is_asleep())
        return false;
    std::ifstream file("/proc/" + std::to_string(pid) + "/wchan");
    std::string name;
    return (!(file >> name) || name == "0") && is_asleep();
}

} // namespace arhost::test
