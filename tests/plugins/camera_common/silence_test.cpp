// SPDX-License-Identifier: Apache-2.0
#include "camera_common/silence.hpp"

#include <gtest/gtest.h>

using arhost::Silence;
using namespace std::chrono_literals;

TEST(Silence, ExceedsItsLimitAfterFiveSeconds) {
    const Silence::Clock::time_point begin{};
    Silence silence(begin);
    for (auto passed = 0ms; passed <= 5s; passed += 100ms)
        EXPECT_FALSE(silence.exceeds_limit(begin + passed)) << passed.count();
    EXPECT_TRUE(silence.exceeds_limit(begin + 5100ms));
}

TEST(Silence, ExcludesTimeInWhichTheProcessWasSuspended) {
    const Silence::Clock::time_point begin{}, resumed = begin + 1h;
    Silence silence(begin);
    EXPECT_FALSE(silence.exceeds_limit(begin + 1s));
    EXPECT_FALSE(silence.exceeds_limit(resumed));
    for (auto passed = 0ms; passed <= 3s; passed += 100ms)
        EXPECT_FALSE(silence.exceeds_limit(resumed + passed)) << passed.count();
    EXPECT_TRUE(silence.exceeds_limit(resumed + 3100ms));
}
