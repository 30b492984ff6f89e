// SPDX-License-Identifier: Apache-2.0
#include "sink_under_test.hpp"

#include <chrono>

using arhost::test::SinkUnderTest;
using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

TEST(SinkNull, AcceptsEveryFrameImmediately) {
    SinkUnderTest sink("sink_null", {});
    ASSERT_EQ(sink.start(64, 48), ARHOST_STATUS_OK);
    EXPECT_EQ(sink.write(0, 100), ARHOST_STATUS_OK);
    EXPECT_EQ(sink.stop(), ARHOST_STATUS_OK);
    EXPECT_EQ(sink.log(), "");
    EXPECT_EQ(sink.descriptor().capabilities, 0u);
    EXPECT_EQ(sink.functions().idle, nullptr);
}

TEST(SinkNull, TakesAsLongAsItsDelay) {
    SinkUnderTest sink("sink_null", {{"delay_ms", "25"}});
    ASSERT_EQ(sink.start(64, 48), ARHOST_STATUS_OK);
    const auto begin = Clock::now();
    EXPECT_EQ(sink.write(0, 4), ARHOST_STATUS_OK);
    EXPECT_GE(Clock::now() - begin, 100ms);
}

TEST(SinkNull, CancellingEndsTheDelay) {
    SinkUnderTest sink("sink_null", {{"delay_ms", "600000"}});
    ASSERT_EQ(sink.start(64, 48), ARHOST_STATUS_OK);
    sink.cancel(3); // while it waits
    EXPECT_EQ(sink.write(0), ARHOST_STATUS_ERROR_CANCELLED);
}
