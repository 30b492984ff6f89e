// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <concepts>
#include <thread>

namespace arhost::test {

// Waits until a condition holds; returns whether it does. The limit is so long that a test reaches it only if the
// condition never becomes true.
template <std::predicate Condition>
bool eventually(Condition &&condition, std::chrono::seconds limit = std::chrono::seconds(60)) {
    using Clock = std::chrono::steady_clock;
    for (const auto end = Clock::now() + limit; !condition();) {
        if (Clock::now() > end)
            return condition();
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return true;
}

} // namespace arhost::test
