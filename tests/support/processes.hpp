// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fstream>
#include <string>
#include <sys/types.h>

namespace arhost::test {

// Returns whether a process is running. Returns false for a zombie, which may remain forever if there is no init
// process to reap it.
inline bool is_alive(pid_t pid) {
    std::ifstream status("/proc/" + std::to_string(pid) + "/status");
    std::string word;
    while (status >> word && word != "State:") {
    }
    return status >> word && word != "Z" && word != "X";
}

} // namespace arhost::test
