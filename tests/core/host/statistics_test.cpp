// SPDX-License-Identifier: Apache-2.0
#include "host/statistics.hpp"

#include <gtest/gtest.h>

#include <algorithm>

using namespace arhost::host;

TEST(Timing, ReturnsNearestRanksWithinHalfAPercent) {
    Timing timing;
    for (int ms = 1000; ms >= 1; --ms)
        timing.add(std::chrono::milliseconds(ms));
    EXPECT_EQ(timing.count(), 1000u);
    EXPECT_NEAR(timing.percentile_ms(0.50), 500, 2.5);
    EXPECT_NEAR(timing.percentile_ms(0.95), 950, 4.75);
    EXPECT_NEAR(timing.percentile_ms(0.99), 990, 4.95);
    EXPECT_DOUBLE_EQ(timing.max_ms(), 1000);
    EXPECT_LE(timing.percentile_ms(1), timing.max_ms());
}

TEST(Timing, KeepsRareLongDurationsApart) {
    Timing timing;
    for (int i = 0; i < 995; ++i)
        timing.add(std::chrono::microseconds(10));
    for (int i = 0; i < 5; ++i)
        timing.add(std::chrono::seconds(2));
    const auto json = timing.to_json();
    EXPECT_NEAR(json["p99_ms"], 0.01, 0.0001);
    EXPECT_DOUBLE_EQ(json["max_ms"], 2000);
}

TEST(Timing, HandlesNoSamplesAndNonPositiveDurations) {
    Timing timing;
    EXPECT_EQ(timing.percentile_ms(0.5), 0);
    timing.add(std::chrono::nanoseconds(0));
    timing.add(std::chrono::nanoseconds(-5)); // a negative duration, as from a clock that ran backwards
    EXPECT_EQ(timing.count(), 2u);
    EXPECT_LE(timing.percentile_ms(0.99), 1e-5);
}

TEST(Timeline, HasOneLinePerFrame) {
    using namespace std::chrono_literals;
    Statistics statistics;
    statistics.first_frame = std::chrono::steady_clock::time_point(10s);
    FrameTimes times;
    times.frame = 7;
    times.shown = statistics.first_frame + 1500ms;
    times.source = 1ms;
    times.tracker = 2ms;
    times.raytracer = 3500us;
    times.device = 3ms;
    times.composite = 4ms;
    times.latency = 12ms;
    statistics.timeline = {times, FrameTimes{.frame = 8, .shown = times.shown}};
    EXPECT_EQ(timeline_csv(statistics),
              "frame,shown_s,source_ms,tracker_ms,raytracer_ms,device_ms,composite_ms,latency_ms\n"
              "7,1.500000,1.000000,2.000000,3.500000,3.000000,4.000000,12.000000\n"
              "8,1.500000,0.000000,0.000000,0.000000,0.000000,0.000000,0.000000\n");
}

TEST(Timeline, FormatsTheLongestDurationsAWorkerCanReport) {
    Statistics statistics;
    const auto longest = std::chrono::nanoseconds::min(); // the longest text, as it has a sign
    statistics.timeline = {{UINT64_MAX, std::chrono::steady_clock::time_point(longest), longest, longest, longest,
                            longest, longest, longest}};
    const std::string text = timeline_csv(statistics);
    EXPECT_EQ(std::count(text.begin(), text.end(), ','), 2 * 7);
    EXPECT_TRUE(text.ends_with(",-9223372036854.775391\n")) << text;
}

TEST(Statistics, ComputeFpsBetweenTheFirstAndTheLastFrame) {
    Statistics statistics;
    EXPECT_EQ(statistics.fps(), 0);
    statistics.composited = 31;
    statistics.first_frame = std::chrono::steady_clock::time_point(std::chrono::seconds(10));
    statistics.last_frame = std::chrono::steady_clock::time_point(std::chrono::seconds(11));
    EXPECT_DOUBLE_EQ(statistics.fps(), 30);
}

TEST(Statistics, OmitTheLimitsOfTheQualityThatDoNotApply) {
    Statistics statistics;
    EXPECT_EQ(quality_json(statistics), nullptr);
    statistics.quality = Quality();
    EXPECT_EQ(quality_json(statistics), (nlohmann::ordered_json{{"scale", 1.0}, {"changes", 0}}));
    statistics.quality = {.scale = 0.5, .samples = 3, .shading_px = 2};
    statistics.quality_changes = 4;
    EXPECT_EQ(quality_json(statistics),
              (nlohmann::ordered_json{{"scale", 0.5}, {"changes", 4}, {"samples", 3}, {"shading_px", 2}}));
}

TEST(StageTimings, RecentOnesAreThoseOfTheLastTwoWindows) {
    using namespace std::chrono_literals;
    StageTimings timings;
    const auto begin = StageTimings::Clock::time_point(1h);
    for (int i = 0; i < 160; ++i) // 10 per second, in windows of just over 5 s; later ones are longer
        timings.add("tracker", i < 100 ? 1ms : 4ms, begin + i * 100ms);
    EXPECT_EQ(timings.all().at("tracker").count(), 160u);
    const Timing recent = timings.recent().at("tracker");
    EXPECT_GE(recent.count(), 50u);
    EXPECT_LE(recent.count(), 102u);
    EXPECT_NEAR(recent.percentile_ms(1), 4, 0.04);
    EXPECT_NEAR(timings.recent_rate("tracker", begin + 16s), 10, 0.3);
    EXPECT_EQ(timings.recent_rate("raytracer", begin + 16s), 0);
}

TEST(Timing, AddsAnotherTiming) {
    Timing sum, other;
    for (int i = 0; i < 3; ++i)
        sum.add(std::chrono::milliseconds(1));
    other.add(std::chrono::milliseconds(9));
    sum.add(other);
    EXPECT_EQ(sum.count(), 4u);
    EXPECT_NEAR(sum.percentile_ms(0.5), 1, 0.01);
    EXPECT_EQ(sum.max_ms(), 9);
}

TEST(Percentiles, AreOneLineOfLatenciesThenStages) {
    using namespace std::chrono_literals;
    StageTimings stages, latencies;
    stages.add("tracker", 2ms);
    stages.add("latency", 12ms);
    stages.add("sink_window", 1ms);
    latencies.add("sink_window", 20ms);
    EXPECT_EQ(percentiles_text(stages.all(), latencies.all()),
              "ms p50/p95/p99:  latency 12.0/12.0/12.0  to sink_window 20.0/20.0/20.0  tracker 2.0/2.0/2.0");
}
