// SPDX-License-Identifier: Apache-2.0
//
// The resources that this process uses, for tests that detect leaks, and its clock.
#pragma once

#include <time.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace arhost::test {

inline std::int64_t monotonic_ns() {
    timespec time{};
    clock_gettime(CLOCK_MONOTONIC, &time);
    return time.tv_sec * std::int64_t{1'000'000'000} + time.tv_nsec;
}

inline std::size_t open_files() {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {}));
}

// A value of /proc/PID/status in KiB.
inline std::size_t memory_kib(const std::string &name, pid_t pid = ::getpid()) {
    std::ifstream status("/proc/" + std::to_string(pid) + "/status");
    for (std::string line; std::getline(status, line);)
        if (line.starts_with(name + ":"))
            return std::stoul(line.substr(name.size() + 1));
    return 0;
}
inline std::size_t resident_kib() {
    return memory_kib("VmRSS");
}

} // namespace arhost::test
