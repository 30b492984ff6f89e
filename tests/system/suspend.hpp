// SPDX-License-Identifier: Apache-2.0
//
// Suspends a virtual machine.
#pragma once

#include <fstream>

namespace arhost::test {

// Suspends all processes for 8 s, as before a suspend of the computer, while CLOCK_MONOTONIC continues. Devices are
// not suspended, because the virtual machine would lose its files. Returns false on failure.
inline bool suspend_processes() {
    const auto write = [](const char *file, const char *text) {
        return static_cast<bool>(std::ofstream(file) << text << std::flush);
    };
    if (!write("/sys/power/pm_test", "freezer") || !write("/sys/module/suspend/parameters/pm_test_delay", "8"))
        return false;
    for (int attempt = 0; attempt < 3; ++attempt) // fails if a process waits for a file of the virtual machine's host
        if (write("/sys/power/state", "freeze"))
            return true;
    return false;
}

} // namespace arhost::test
