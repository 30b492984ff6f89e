// SPDX-License-Identifier: Apache-2.0
#include "supervise/restart_policy.hpp"

#include <gtest/gtest.h>

using namespace arhost::supervise;
using namespace std::chrono_literals;

TEST(RestartPolicy, DoublesItsDelayAndThenGivesUp) {
    RestartPolicy policy(
        {.proven_after_frames = 10, .quarantine_after = 5, .first_delay = 250ms, .longest_delay = 1500ms});
    EXPECT_EQ(policy.died(0), 250ms);
    EXPECT_EQ(policy.died(0), 500ms);
    EXPECT_EQ(policy.died(0), 1000ms);
    EXPECT_EQ(policy.died(0), 1500ms) << "not longer than the longest";
    EXPECT_EQ(policy.died(0), std::nullopt);
}

TEST(RestartPolicy, RestartsAProvenComponentAtOnceHoweverOftenItDies) {
    RestartPolicy policy({});
    for (int i = 0; i < 10; ++i)
        policy.frame_done();
    for (int death = 0; death < 100; ++death) {
        EXPECT_EQ(policy.died(1), 0ms);
        policy.frame_done();
    }
}

TEST(RestartPolicy, CountsDeathsBeforeTheFirstFrameOfALifeEvenOfAProvenComponent) {
    RestartPolicy policy({});
    for (int i = 0; i < 50; ++i)
        policy.frame_done();
    EXPECT_EQ(policy.died(0), 0ms);
    for (int i = 0; i < 4; ++i)
        EXPECT_GE(policy.died(0), 250ms);
    EXPECT_EQ(policy.died(0), std::nullopt);
}

TEST(RestartPolicy, CountsDeathsWithinTheFirstTenFrames) {
    RestartPolicy policy({});
    for (int death = 0; death < 2; ++death) {
        policy.frame_done();
        EXPECT_GE(policy.died(0), 250ms);
    }
    EXPECT_EQ(policy.failures(), 2u);
}

TEST(RestartPolicy, AddsUpToAQuarterOfJitter) {
    RestartPolicy policy({});
    EXPECT_EQ(policy.died(1), 312ms);
}
