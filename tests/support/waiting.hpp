// SPDX-License-Identifier: Apache-2.0
//
// Tests wait for other processes with these functions, which return once an event has occurred.
#pragma once

#include <chrono>
#include <cstdlib>
#include <thread>

namespace arhost::test {

// Multiplies a time with the environment variable ARHOST_TEST_TIME_SCALE, which slow machines set.
inline std::chrono::milliseconds scaled(std::chrono::milliseconds time) {
    const char *text = std::getenv("ARHOST_TEST_TIME_SCALE");
    const double scale = text ? std::atof(text) : 1;
    return std::chrono::duration_cast<std::chrono::milliseconds>(time * (scale > 0 ? scale : 1));
}

// Calls `condition` until it returns true. Returns false after `limit`, which only a defect exceeds. The default is
// shorter than the limits that CTest sets for tests, so that the test reports the defect itself.
template <class Condition>
[[nodiscard]] bool eventually(const Condition &condition,
                              std::chrono::milliseconds limit = std::chrono::seconds(30)) {
    const auto end = std::chrono::steady_clock::now() + scaled(limit);
    while (!condition()) {
        if (std::chrono::steady_clock::now() > end)
            return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return true;
}

} // namespace arhost::test
