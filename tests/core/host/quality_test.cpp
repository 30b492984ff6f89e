// SPDX-License-Identifier: Apache-2.0
#include "host/quality.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <vector>

using namespace arhost::host;

namespace {

using namespace std::chrono_literals;
using Limits = QualityController::Limits;
constexpr Limits full_limits{.target_fps = 30, .min_scale = 0.5, .min_samples = 1, .max_samples = 4},
    with_shading{.target_fps = 30, .min_scale = 0.5, .min_samples = 1, .max_samples = 4, .max_shading_px = 2};

// A ray tracer whose image takes fixed_ms + ms · scale² · samples, times a noise of ± `noise`. Half of `ms` is for
// shading.
class Simulation {
public:
    // `unshaded`: the share of the time that does not depend on the number of shaded pixels.
    explicit Simulation(const Limits &limits, double unshaded = 0.5) : controller(limits), unshaded_(unshaded) {}

    void run(std::chrono::seconds duration, double ms, double fixed_ms = 0, double noise = 0) {
        std::uniform_real_distribution<double> factor(1 - noise, 1 + noise);
        for (const auto end = now_ + duration; now_ < end;) {
            const Quality quality = controller.current();
            const double shaded = 1.0 / (quality.shading_px * quality.shading_px);
            last_ms = fixed_ms + ms * quality.scale * quality.scale * std::max(quality.samples, 1u) *
                                     (unshaded_ + (1 - unshaded_) * shaded);
            const auto time = std::chrono::duration_cast<std::chrono::nanoseconds>(
                std::chrono::duration<double, std::milli>(last_ms * factor(random_)));
            now_ += std::max<std::chrono::nanoseconds>(time, 33ms); // the camera's rate
            controller.add(quality, time, now_);
        }
    }

    QualityController controller;
    double last_ms = 0; // render time without noise

private:
    double unshaded_;
    QualityController::Clock::time_point now_{1h};
    std::minstd_rand random_{1};
};

} // namespace

TEST(Quality, StaysFullWithoutLoad) {
    Simulation simulation(full_limits);
    simulation.run(600s, 6, 0, 0.3);
    EXPECT_EQ(simulation.controller.current(), (Quality{1, 4}));
    EXPECT_EQ(simulation.controller.changes(), 0u);
}

TEST(Quality, ReachesTheTargetAfterAStepOfTheLoad) {
    Simulation simulation(full_limits);
    simulation.run(10s, 6);
    simulation.run(3s, 60);
    EXPECT_LE(simulation.last_ms, 33.4);
    EXPECT_EQ(simulation.controller.current().samples, 1u);
    EXPECT_LT(simulation.controller.current().scale, 1);
}

TEST(Quality, ReducesSamplesBeforeTheScale) {
    Simulation simulation(full_limits);
    simulation.run(5s, 12); // 48 ms with 4 samples, 24 ms with 2
    EXPECT_EQ(simulation.controller.current(), (Quality{1, 2}));
}

TEST(Quality, ReducesTheShadedPixelsBetweenSamplesAndScale) {
    std::vector<Quality> levels{Quality{1, 4}};
    Simulation simulation(with_shading);
    for (double ms = 2; ms < 300; ms *= 1.02) {
        simulation.run(2s, ms);
        if (const Quality now = simulation.controller.current(); now != levels.back())
            levels.push_back(now);
    }
    ASSERT_GE(levels.size(), 5u);
    EXPECT_EQ(levels[1], (Quality{1, 2, 1}));
    EXPECT_EQ(levels[2], (Quality{1, 1, 1}));
    EXPECT_EQ(levels[3], (Quality{1, 1, 2}));
    for (std::size_t i = 4; i < levels.size(); ++i) {
        EXPECT_LT(levels[i].scale, levels[i - 1].scale);
        EXPECT_EQ(levels[i].samples, 1u);
        EXPECT_EQ(levels[i].shading_px, 2u) << "also in smaller images";
    }
    EXPECT_EQ(levels.back().scale, 0.5);
    simulation.run(60s, 5);
    EXPECT_EQ(simulation.controller.current(), (Quality{1, 4, 1}));
}

TEST(Quality, ShadesAQuarterOfThePixelsIfThatIsEnough) {
    Simulation simulation({.target_fps = 30, .min_scale = 0.5, .max_shading_px = 2});
    simulation.run(60s, 40); // 25 ms with a quarter
    EXPECT_EQ(simulation.controller.current(), (Quality{1, 0, 2}));
    EXPECT_EQ(simulation.controller.changes(), 1u);
}

TEST(Quality, StopsAtTheLimits) {
    Simulation simulation(full_limits);
    simulation.run(60s, 1000);
    EXPECT_EQ(simulation.controller.current(), (Quality{0.5, 1}));
    EXPECT_TRUE(simulation.controller.is_lowest());
    EXPECT_EQ(simulation.controller.changes(), 1u) << "goes straight to the level that it needs";
    Simulation fixed({.target_fps = 30});
    fixed.run(60s, 1000);
    EXPECT_EQ(fixed.controller.current(), (Quality{1, 0}));
    EXPECT_EQ(fixed.controller.changes(), 0u);
}

TEST(Quality, AdaptsTheScaleAloneIfTheRayTracerHasNoSamples) {
    Simulation simulation({.target_fps = 30, .min_scale = 0.25});
    simulation.run(10s, 100);
    EXPECT_EQ(simulation.controller.current().samples, 0u);
    EXPECT_LE(simulation.last_ms, 33.4);
}

TEST(Quality, RecoversWhenTheLoadEnds) {
    Simulation simulation(full_limits);
    simulation.run(10s, 200);
    EXPECT_TRUE(simulation.controller.is_lowest());
    simulation.run(30s, 5);
    EXPECT_EQ(simulation.controller.current(), (Quality{1, 4}));
    simulation.run(10s, 200); // and again
    simulation.run(30s, 5);
    EXPECT_EQ(simulation.controller.current(), (Quality{1, 4}));
}

TEST(Quality, NeverOscillatesAtAConstantLoad) {
    for (const Limits &limits : {full_limits, with_shading})
        for (double ms = 2; ms < 400; ms *= 1.2)
            for (const double fixed_ms : {0.0, 5.0, 20.0})
                for (const double noise : {0.0, 0.1, 0.3}) {
                    Simulation simulation(limits);
                    simulation.run(20s, ms, fixed_ms, noise);
                    const std::uint64_t changes = simulation.controller.changes();
                    EXPECT_LE(changes, 6u) << ms << " ms + " << fixed_ms << " ms, noise " << noise;
                    simulation.run(600s, ms, fixed_ms, noise);
                    EXPECT_LE(simulation.controller.changes(), changes + 2)
                        << ms << " ms + " << fixed_ms << " ms, noise " << noise;
                }
}

// Also if the shading takes much more, or less, of the time than predicted.
TEST(Quality, NeverOscillatesWhateverTheShadingTakes) {
    for (const double unshaded : {0.0, 0.1, 0.2, 0.8, 1.0})
        for (double ms = 2; ms < 100; ms *= 1.05) {
            Simulation simulation(with_shading, unshaded);
            simulation.run(20s, ms);
            const std::uint64_t changes = simulation.controller.changes();
            simulation.run(600s, ms);
            EXPECT_LE(simulation.controller.changes(), changes + 4) << ms << " ms, unshaded " << unshaded;
        }
}

// The cost model predicts that the better level is affordable, but it is not.
TEST(Quality, DoesNotTryAgainWhatWasTooSlow) {
    QualityController controller({.target_fps = 30, .min_samples = 1, .max_samples = 2});
    auto now = QualityController::Clock::time_point(1h);
    const auto run = [&](std::chrono::seconds duration, std::chrono::nanoseconds with_two,
                         std::chrono::nanoseconds with_one) {
        for (const auto end = now + duration; now < end;) {
            const Quality quality = controller.current();
            now += 40ms;
            controller.add(quality, quality.samples == 2 ? with_two : with_one, now);
        }
    };
    run(3600s, 40ms, 10ms);
    EXPECT_EQ(controller.current().samples, 1u);
    EXPECT_EQ(controller.changes(), 3u) << "down, one attempt, down again";
    run(60s, 20ms, 5ms);
    EXPECT_EQ(controller.current().samples, 2u) << "the load has decreased";
}

TEST(AdaptableReports, AreFollowedIfAllImagesOfASecondRepeatThem) {
    AdaptableReports reports;
    auto now = AdaptableReports::Clock::time_point(1h);
    const Adaptable first{8, 2}, second{4, 2};
    EXPECT_FALSE(reports.latest());
    EXPECT_TRUE(reports.add(first, now));
    EXPECT_EQ(reports.latest(), first);
    for (int i = 0; i < 10; ++i, now += 100ms)
        EXPECT_FALSE(reports.add(second, now));
    EXPECT_EQ(reports.latest(), first);
    EXPECT_TRUE(reports.add(second, now));
    EXPECT_EQ(reports.latest(), second);
}

TEST(AdaptableReports, AreIgnoredIfTheyAlternate) {
    AdaptableReports reports;
    auto now = AdaptableReports::Clock::time_point(1h);
    for (int i = 0; i < 300; ++i, now += 33ms)
        EXPECT_EQ(reports.add({8, i % 3 == 1 ? 0u : 2u}, now), i == 0) << i;
    for (std::uint32_t i = 0; i < 300; ++i, now += 33ms)
        EXPECT_FALSE(reports.add({8 + i, 2}, now)) << i;
}

TEST(Quality, IgnoresASingleSlowImageAndImagesOfAnotherQuality) {
    QualityController controller(full_limits);
    auto now = QualityController::Clock::time_point(1h);
    for (int i = 0; i < 1000; ++i) {
        now += 33ms;
        controller.add(controller.current(), i % 10 == 0 ? 500ms : 10ms, now);
        controller.add({0.5, 1}, 500ms, now);
    }
    EXPECT_EQ(controller.changes(), 0u);
}
