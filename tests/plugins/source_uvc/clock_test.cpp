// SPDX-License-Identifier: Apache-2.0
#include "clock.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

using namespace arhost::uvc;

namespace {

constexpr std::int64_t ms = 1'000'000, second = 1'000'000'000, frame_ns = 33'333'333;
constexpr std::uint32_t frequency = 48'000'000;

// A camera whose clock runs at a rate that differs from the stated one, and whose payloads arrive late.
struct Camera {
    double rate = 1 + 80e-6;
    std::uint32_t start_ticks = 4'000'000'000; // overflows soon
    std::minstd_rand random{5};
    std::int64_t start_ns = 100 * second;

    std::uint32_t ticks_at(std::int64_t host_ns) const {
        const double elapsed = static_cast<double>(host_ns - start_ns) / 1e9;
        return start_ticks + static_cast<std::uint32_t>(std::llround(elapsed * frequency * rate));
    }
    // After 0.1 to 4.1 ms, and sometimes 50 ms; in the order of sending.
    std::int64_t arrival_of(std::int64_t sent_ns) {
        const auto jitter = static_cast<std::int64_t>(random() % 4'000'000);
        return last_arrival_ns =
                   std::max(last_arrival_ns, sent_ns + ms / 10 + (random() % 10 == 0 ? 50 * ms : jitter));
    }
    std::int64_t last_arrival_ns = 0;
    // Sends the start of a frame; returns when.
    std::int64_t send(int frame, DeviceClock &clock) {
        const std::int64_t sent = start_ns + frame * frame_ns;
        clock.add(ticks_at(sent), arrival_of(sent));
        return sent;
    }
};

} // namespace

TEST(DeviceClock, FollowsTheCameraInSpiteOfLateArrivals) {
    Camera camera;
    DeviceClock clock(frequency);
    for (int frame = 0; frame < 1500; ++frame) { // 50 s
        const std::int64_t sent = camera.send(frame, clock);
        if (frame < 100)
            continue;
        const auto host = clock.host_ns(camera.ticks_at(sent - 20 * ms));
        ASSERT_TRUE(host);
        ASSERT_NEAR(static_cast<double>(*host - (sent - 20 * ms)), 0, 1e6) << "frame " << frame;
    }
}

TEST(DeviceClock, IsUnknownUntilThereAreSamples) {
    Camera camera;
    DeviceClock clock(frequency);
    EXPECT_FALSE(clock.host_ns(0));
    for (int frame = 0; frame < 8; ++frame) {
        EXPECT_FALSE(clock.host_ns(camera.ticks_at(camera.start_ns))) << frame;
        camera.send(frame, clock);
    }
    EXPECT_TRUE(clock.host_ns(camera.ticks_at(camera.start_ns)));
}

TEST(DeviceClock, IsUnknownIfItDoesNotRunAtTheStatedFrequency) {
    Camera camera;
    for (const std::uint32_t stated : {0u, frequency / 10 * 11, frequency / 10 * 9, frequency / 100}) {
        DeviceClock clock(stated);
        for (int frame = 0; frame < 300; ++frame)
            camera.send(frame, clock);
        EXPECT_FALSE(clock.host_ns(camera.ticks_at(camera.start_ns + 300 * frame_ns))) << stated;
    }
}

TEST(DeviceClock, StartsAgainAfterAReset) {
    Camera camera;
    DeviceClock clock(frequency);
    const auto run = [&](int from, int to) {
        for (int frame = from; frame < to; ++frame)
            camera.send(frame, clock);
    };
    run(0, 200);
    camera.start_ticks += 10 * frequency;
    run(200, 201);
    EXPECT_FALSE(clock.host_ns(0));
    run(201, 400);
    const std::int64_t sent = camera.start_ns + 400 * frame_ns;
    EXPECT_NEAR(static_cast<double>(*clock.host_ns(camera.ticks_at(sent)) - sent), 0, 1e6);
}

TEST(CaptureTimes, NeverDecreaseAndAreNeverLaterThanTheArrival) {
    Camera camera;
    CaptureTimes times(frequency);
    std::minstd_rand random(9);
    std::int64_t last = 0, earlier_than_arrival = 0;
    for (int frame = 0; frame < 1000; ++frame) {
        const std::int64_t sent = camera.start_ns + frame * frame_ns, arrival = camera.arrival_of(sent);
        const bool lies = random() % 5 == 0;
        times.add_clock(lies && frame % 2 ? static_cast<std::uint32_t>(random()) : camera.ticks_at(sent), arrival);
        const std::int64_t time =
            times.time_of(lies ? static_cast<std::uint32_t>(random() * 3) : camera.ticks_at(sent - 10 * ms), arrival);
        ASSERT_GE(time, last);
        ASSERT_LE(time, arrival);
        last = time;
        earlier_than_arrival += time < arrival;
    }
    EXPECT_GT(earlier_than_arrival, 100);
}

TEST(CaptureTimes, AreThoseOfTheArrivalWithoutAClock) {
    CaptureTimes times(frequency);
    EXPECT_EQ(times.time_of(std::nullopt, 5 * second), 5 * second);
    EXPECT_EQ(times.time_of(12345, 6 * second), 6 * second);
}
