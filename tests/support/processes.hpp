// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fstream>
#include <string>
#include <sys/types.h>

namespace arhost::test {

// A zombie is not, which nobody may wait for where no init does.
inline bool is_alive(pid_t pid) {
    std::ifstream status("/proc/" + std::to_string(pid) + "/status");
    std::string word;
    while (status >> word && word != "State:") {
    }
    return status >> word && word != "Z" && word != "X";
}

} // namespace arhost::test
