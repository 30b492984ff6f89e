// SPDX-License-Identifier: Apache-2.0
#include "host/frames.hpp"

#include <gmock/gmock.h>

using namespace arhost::host;

namespace {

constexpr std::int64_t now_ns = 100'000'000'000;

const char *problem_with(arhost_clock clock, std::int64_t capture_ns, std::int64_t previous_capture_ns = INT64_MIN) {
    arhost_frame_info info{};
    info.clock = clock;
    info.capture_ns = capture_ns;
    arhost_record record{};
    const char *problem = accept_frame_info(info, previous_capture_ns, now_ns, record);
    if (!problem) {
        EXPECT_EQ(record.clock, clock);
        EXPECT_EQ(record.capture_ns, capture_ns);
    }
    return problem;
}

} // namespace

TEST(DeviceTime, IsIgnoredIfLongerThanTheRenderCall) {
    using namespace std::chrono_literals;
    const auto accepted = [](std::uint64_t ns, std::chrono::nanoseconds busy) {
        arhost_render_info info{};
        info.device_time_ns = ns;
        return device_time(info, busy);
    };
    EXPECT_EQ(accepted(3'000'000, 5ms), 3ms);
    EXPECT_EQ(accepted(5'000'000, 5ms), 5ms);
    EXPECT_EQ(accepted(5'000'001, 5ms), 0ns);
    EXPECT_EQ(accepted(0, 5ms), 0ns);
    EXPECT_EQ(accepted(UINT64_MAX, 5ms), 0ns) << "UINT64_MAX is -1 as a signed number";
    EXPECT_EQ(accepted(1, -5ms), 0ns) << "the worker also reports the duration, which may be negative";
    EXPECT_EQ(accepted(UINT64_MAX, -1ns), 0ns);
}

TEST(FrameInfo, IsRejectedWithoutAClock) {
    EXPECT_STREQ(problem_with(0, now_ns), "a frame's clock is not set");
    EXPECT_STREQ(problem_with(3, now_ns), "a frame's clock is not set");
}

TEST(FrameInfo, IsRejectedIfItsTimeRunsBackwards) {
    EXPECT_EQ(problem_with(ARHOST_CLOCK_MONOTONIC, now_ns - 5, now_ns - 5), nullptr);
    EXPECT_STREQ(problem_with(ARHOST_CLOCK_MONOTONIC, now_ns - 6, now_ns - 5),
                 "a frame's capture time is before that of the previous frame");
}

TEST(FrameInfo, IsRejectedIfALiveTimeIsFarInTheFuture) {
    EXPECT_EQ(problem_with(ARHOST_CLOCK_MONOTONIC, INT64_MIN), nullptr) << "any age is accepted";
    EXPECT_EQ(problem_with(ARHOST_CLOCK_MONOTONIC, now_ns + 1'000'000'000), nullptr);
    const char *problem = "a frame's capture time is more than a second ahead of the clock";
    EXPECT_STREQ(problem_with(ARHOST_CLOCK_MONOTONIC, now_ns + 1'000'000'001), problem);
    EXPECT_STREQ(problem_with(ARHOST_CLOCK_MONOTONIC, INT64_MAX), problem);
    EXPECT_EQ(problem_with(ARHOST_CLOCK_MEDIA, INT64_MAX), nullptr) << "media time is unrelated to the current time";
}
