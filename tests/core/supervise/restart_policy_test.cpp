// SPDX-License-Identifier: Apache-2.0
#include "supervise/restart_policy.hpp"

#include <gtest/gtest.h>

using namespace arhost::supervise;
using namespace std::chrono_literals;

TEST(RestartPolicy, DoublesTheDelayAndThenDisables) {
    RestartPolicy policy(
        {.proven_after_frames = 10, .quarantine_after = 5, .first_delay = 250ms, .longest_delay = 1500ms});
    EXPECT_EQ(policy.delay_after_death(0), 250ms);
    EXPECT_EQ(policy.delay_after_death(0), 500ms);
    EXPECT_EQ(policy.delay_after_death(0), 1000ms);
    EXPECT_EQ(policy.delay_after_death(0), 1500ms) << "at most longest_delay";
    EXPECT_EQ(policy.delay_after_death(0), std::nullopt);
}

TEST(RestartPolicy, AlwaysRestartsAProvenComponentAtOnce) {
    RestartPolicy policy({});
    for (int i = 0; i < 10; ++i)
        policy.frame_done();
    for (int death = 0; death < 100; ++death) {
        EXPECT_EQ(policy.delay_after_death(1), 0ms);
        policy.frame_done();
    }
}

TEST(RestartPolicy, CountsDeathsBeforeTheFirstFrameOfAProcessAsFailures) {
    RestartPolicy policy({});
    for (int i = 0; i < 50; ++i)
        policy.frame_done();
    EXPECT_EQ(policy.delay_after_death(0), 0ms);
    for (int i = 0; i < 4; ++i)
        EXPECT_GE(policy.delay_after_death(0), 250ms);
    EXPECT_EQ(policy.delay_after_death(0), std::nullopt);
}

TEST(RestartPolicy, CountsDeathsOfAnUnprovenComponentAsFailures) {
    RestartPolicy policy({});
    for (int death = 0; death < 2; ++death) {
        policy.frame_done();
        EXPECT_GE(policy.delay_after_death(0), 250ms);
    }
    EXPECT_EQ(policy.failures(), 2u);
}

TEST(RestartPolicy, AddsUpToAQuarterOfJitter) {
    RestartPolicy policy({});
    EXPECT_EQ(policy.delay_after_death(1), 312ms);
}

TEST(RestartPolicy, WaitsForALostDeviceWithoutEnd) {
    RestartPolicy policy({.quarantine_after = 2, .first_delay = 250ms});
    EXPECT_FALSE(policy.has_completed_frames());
    policy.frame_done();
    EXPECT_TRUE(policy.has_completed_frames());
    EXPECT_EQ(policy.delay_while_device_is_lost(0), 0ms);
    EXPECT_EQ(policy.delay_while_device_is_lost(0), 250ms);
    EXPECT_EQ(policy.delay_while_device_is_lost(0), 500ms);
    for (int i = 0; i < 100; ++i)
        policy.delay_while_device_is_lost(0);
    EXPECT_EQ(policy.delay_while_device_is_lost(0), 2000ms);
    EXPECT_EQ(policy.failures(), 0u);
    policy.frame_done();
    EXPECT_EQ(policy.delay_while_device_is_lost(0), 0ms) << "the device was back";
}
