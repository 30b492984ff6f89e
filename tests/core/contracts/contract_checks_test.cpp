// SPDX-License-Identifier: Apache-2.0
#include "contracts/contract_checks.hpp"
#include "pixels/linear.hpp"

#include "camera/lens_model.hpp"
#include "scene/arena_builder.hpp"

#include <gmock/gmock.h>

#include <cstring>
#include <vector>

using namespace arhost;
using namespace arhost::contracts;
using testing::HasSubstr;

namespace {

constexpr arhost_intrinsics lens{
    sizeof(arhost_intrinsics), 640, 480, ARHOST_DISTORTION_NONE, 600, 610, 330, 235, 0, 0, {}, {}};
arhost_observation observation(std::int32_t id, double left_px = 100) {
    return {sizeof(arhost_observation),
            id,
            0,
            0,
            {{left_px, 50}, {left_px + 40, 52}, {left_px + 38, 90}, {left_px, 92}},
            1,
            0,
            0,
            {}};
}

arhost_target target(const char *name) {
    arhost_target t{};
    std::strcpy(t.name, name);
    t.state = ARHOST_TARGET_DETECTED;
    for (int i = 0; i < 36; i += 7)
        t.covariance[i] = 0.25;
    return t;
}

std::string violations(const ContractChecks &checks) {
    std::string text;
    for (const auto &[name, check] : checks.all())
        if (check.violations > 0)
            text += name + ": " + check.first_violation;
    return text;
}

std::string violations_of(const std::vector<arhost_observation> &observations,
                          const std::vector<arhost_target> &targets = {}) {
    ContractChecks checks;
    check_tracking(checks, 12, targets, observations);
    return violations(checks);
}

constexpr std::int64_t ms = 1'000'000;
struct Time {
    std::int64_t capture_ns;
    std::uint32_t skipped = 0;
};
// Frames of a source that was started at time 0. Frame numbers start at 0, and the host receives each frame at
// `now_ns`.
std::string violations_of_times(const SourceChecks::Rate &rate, arhost_clock clock, const std::vector<Time> &times,
                                std::int64_t now_ns) {
    SourceChecks source(rate, 0);
    ContractChecks checks;
    arhost_record r{};
    r.clock = clock;
    for (const Time &time : times) {
        r.capture_ns = time.capture_ns;
        source.check(checks, r, time.skipped, now_ns);
        ++r.sequence;
    }
    return violations(checks);
}

// A scene with a ball of 10 mm radius at the origin; the camera is 200 mm in front of the ball.
struct View {
    explicit View(std::optional<arhost_role> role = ARHOST_ROLE_VIRTUAL)
        : scene(scene_with(role)), pixels(640 * 480 * 4) {}
    static scene::Arena scene_with(std::optional<arhost_role> role) {
        scene::ArenaBuilder builder;
        if (role)
            builder.add_object("ball", builder.add_spheres({{0, 0, 0, 10}}), builder.add_material(arhost_material{}),
                               *role);
        return std::move(builder).build();
    }
    arhost_camera camera{sizeof(arhost_camera), 0, {0, -200, 0}, {0, 0, 0}, {0, 0, 1}, lens, {}};
    scene::Arena scene;
    std::vector<std::uint8_t> pixels;

    void set(std::uint32_t x, std::uint32_t y, int alpha) {
        pixels[4 * (640 * y + x) + 3] = static_cast<std::uint8_t>(alpha);
    }
    std::string violations(const Region &region = {0, 0, 640, 480}) const {
        OverlayChecks overlay(scene.scene());
        ContractChecks checks;
        for (std::uint64_t frame = 0; frame < 16; ++frame) // 16 frames, so that each row is checked once
            overlay.check(checks, frame, camera, region, {pixels.data(), 640 * 4});
        return ::violations(checks);
    }
};

} // namespace

TEST(ContractChecks, CountFramesAndReportTheFirstViolation) {
    std::vector<std::string> reported;
    ContractChecks checks(
        [&](const std::string &name, const std::string &sentence) { reported.push_back(name + " " + sentence); });
    checks.add("a.b", 1, "");
    checks.add("a.b", 2, "is wrong");
    checks.add("a.b", 3, "is wrong again");
    EXPECT_EQ(checks.all().at("a.b").checked, 3u);
    EXPECT_EQ(checks.all().at("a.b").violations, 2u);
    EXPECT_EQ(checks.all().at("a.b").first_violation, "frame 2: is wrong");
    EXPECT_THAT(reported, testing::ElementsAre("a.b frame 2: is wrong"));
}

TEST(TrackingChecks, PassForACorrectTracker) {
    EXPECT_EQ(violations_of({}), "");
    EXPECT_EQ(violations_of({observation(4), observation(7), observation(4, 300)}, {target("cup"), target("desk")}),
              "")
        << "two copies of marker 4 are in view";
    arhost_target body = target("head");
    std::ranges::fill(body.covariance, 0);
    EXPECT_EQ(violations_of({}, {body}), "") << "its covariance is unknown";
}

TEST(TrackingChecks, FailForAWrongTracker) {
    arhost_observation mirrored = observation(4), crossed = observation(4);
    std::swap(mirrored.corners_px[1], mirrored.corners_px[3]);
    std::swap(crossed.corners_px[0], crossed.corners_px[1]);
    for (const arhost_observation &wrong : {mirrored, crossed})
        EXPECT_EQ(violations_of({observation(7), wrong}),
                  "tracker.corners: frame 12: the corners of marker 4 are not convex and clockwise in the image");
    EXPECT_EQ(violations_of({observation(4), observation(7), observation(4)}),
              "tracker.repeats: frame 12: marker 4 is reported twice at the same place");
    arhost_target negative = target("cup"), asymmetric = target("cup");
    negative.covariance[14] = -1;
    asymmetric.covariance[3] = 0.1;
    EXPECT_EQ(violations_of({}, {target("desk"), negative}),
              "tracker.covariance: frame 12: cup has a variance of -1");
    EXPECT_EQ(violations_of({}, {asymmetric}),
              "tracker.covariance: frame 12: cup has a covariance that is not symmetric");
}

TEST(SourceChecks, RequireCaptureTimesBeforeArrivalAndNotNegative) {
    const auto captured = [](arhost_clock clock, std::int64_t capture_ns) {
        return violations_of_times({}, clock, {{capture_ns}}, 100'000'000'000);
    };
    EXPECT_EQ(captured(ARHOST_CLOCK_MONOTONIC, 99'990'000'000), "");
    EXPECT_EQ(captured(ARHOST_CLOCK_MONOTONIC, 100'250'000'000),
              "source.capture-time: frame 0: has a capture time 0.250 s after its arrival at the host");
    EXPECT_EQ(captured(ARHOST_CLOCK_MONOTONIC, 0), "") << "any delay is allowed";
    EXPECT_EQ(captured(ARHOST_CLOCK_MONOTONIC, INT64_MIN), "");
    EXPECT_EQ(captured(ARHOST_CLOCK_MEDIA, 0), "") << "media time is unrelated to the current time";
    EXPECT_EQ(captured(ARHOST_CLOCK_MEDIA, -500'000'000),
              "source.capture-time: frame 0: has the media time -0.500 s, which must not be negative");
}

TEST(SourceChecks, RequireASingleClock) {
    SourceChecks source({}, 0);
    ContractChecks checks;
    for (const arhost_clock clock : {ARHOST_CLOCK_MEDIA, ARHOST_CLOCK_MONOTONIC, ARHOST_CLOCK_MEDIA}) {
        arhost_record r{};
        r.sequence = 12;
        r.clock = clock;
        source.check(checks, r, 0, 0);
    }
    EXPECT_EQ(violations(checks), "source.clock: frame 12: has the clock 1, earlier frames had 2");
    EXPECT_EQ(checks.all().at("source.clock").violations, 1u);
}

TEST(SourceChecks, RequireTheConfiguredRate) {
    const auto configured = [](std::initializer_list<Time> times) {
        return violations_of_times({10, true, false}, ARHOST_CLOCK_MEDIA, times, 0);
    };
    EXPECT_EQ(configured({{0}, {100 * ms}, {200 * ms}}), "");
    EXPECT_EQ(configured({{5000 * ms}, {5100 * ms}}), "") << "media time may start at any value";
    EXPECT_EQ(configured({{0}, {100 * ms}, {500 * ms, 3}, {600 * ms}}), "") << "skipped frames count as frames";
    EXPECT_EQ(configured({{0}, {100 * ms}, {500 * ms}, {600 * ms}}),
              "source.rate: frame 2: has a media time 0.400 s after the previous frame, but 10 fps and 0 skipped "
              "frames require 0.100 s");
    EXPECT_THAT(configured({{0}, {0}}), HasSubstr("has a media time 0.000 s after the previous frame"));
    EXPECT_THAT(configured({{0}, {100 * ms, 1}}), HasSubstr("1 skipped frames require 0.200 s"));
}

TEST(SourceChecks, AllowUnevenTimesOfAVideo) {
    EXPECT_EQ(violations_of_times({10, false, false}, ARHOST_CLOCK_MEDIA, {{0}, {1}, {60'000 * ms}}, 0), "");
}

TEST(SourceChecks, RequireRealTimeInModeLive) {
    const auto live = [](std::initializer_list<Time> times) {
        return violations_of_times({10, false, true}, ARHOST_CLOCK_MEDIA, times, 2000 * ms);
    };
    EXPECT_EQ(live({{0}, {100 * ms}, {1000 * ms}}), "");
    EXPECT_EQ(live({{0}, {100 * ms}, {10'000 * ms}}), "source.rate: frame 2: has a media time 10.000 s after the "
                                                      "first frame, but arrived only 2.000 s after the start");
}

TEST(SourceChecks, DoNotCheckTheRateOfALiveSource) {
    EXPECT_EQ(violations_of_times({}, ARHOST_CLOCK_MEDIA, {{0}, {1}, {3'600'000 * ms}}, 0), "");
}

TEST(SampleHash, DetectsAnyChangeWithinSixteenFrames) {
    std::vector<std::byte> bytes(300'000);
    const auto samples = [&] {
        std::vector<std::size_t> all;
        for (std::uint64_t frame = 0; frame < 16; ++frame)
            all.push_back(sample_hash(bytes, frame));
        return all;
    };
    const auto before = samples();
    EXPECT_EQ(samples(), before);
    for (const std::size_t at : {std::size_t{0}, std::size_t{123'456}, bytes.size() - 1}) {
        bytes[at] ^= std::byte{1};
        EXPECT_NE(samples(), before) << at;
        bytes[at] ^= std::byte{1};
    }
}

TEST(OverlayChecks, PassForACorrectRayTracer) {
    View view;
    view.set(330, 235, 255); // the ball's centre
    view.set(330, 206, 90);  // the ball's edge: 10 mm correspond to 30 px
    view.set(10, 10, 153);   // a shadow, which may be anywhere
    EXPECT_EQ(view.violations(), "");
}

TEST(OverlayChecks, FailOutsideTheRegionAndTheObjects) {
    View view;
    view.set(100, 50, 255);
    EXPECT_EQ(
        view.violations({300, 200, 60, 70}),
        "raytracer.region: frame 2: pixel (100, 50) is outside the reported region, but has alpha 255; the region is "
        "60 x 70 px at (300, 200)");
    EXPECT_EQ(view.violations(),
              "raytracer.place: frame 2: pixel (100, 50): alpha is 255, but all virtual objects are "
              "between (297, 201) and (363, 269)");
}

TEST(OverlayChecks, DoNotTreatACatcherAsAVirtualObject) {
    View view(ARHOST_ROLE_CATCHER);
    view.set(330, 235, 255);
    EXPECT_THAT(view.violations(), HasSubstr("alpha is 255, but there is no virtual object"));
    View empty(std::nullopt);
    empty.set(330, 235, 153);
    EXPECT_EQ(empty.violations(), "");
}

// A linear image of the same view, untouched but for the pixels that a test sets.
struct LinearView : View {
    std::vector<LinearPixel> light = std::vector<LinearPixel>(std::size_t{640} * 480, untouched);
    std::string violations(const Region &region = {0, 0, 640, 480}) const {
        OverlayChecks overlay(scene.scene());
        ContractChecks checks;
        for (std::uint64_t frame = 0; frame < 16; ++frame)
            overlay.check(checks, frame, camera, region,
                          {reinterpret_cast<const std::uint8_t *>(light.data()),
                           640 * sizeof(LinearPixel),
                           {ARHOST_IMAGE_FORM_LINEAR, ARHOST_COMPOSITING_LINEAR}});
        return ::violations(checks);
    }
    LinearPixel &at(std::uint32_t x, std::uint32_t y) { return light[640 * y + x]; }
};

TEST(OverlayChecks, PassForACorrectLinearImage) {
    LinearView view;
    view.at(330, 235) = linear_pixel({4, 2, 1}, {0, 0, 0});       // the ball's centre
    view.at(330, 206) = linear_pixel({1, 1, 1}, {0.5f, 0.5f, 1}); // the ball's edge
    view.at(10, 10) = linear_pixel({0, 0, 0}, {0, 0, 0});         // a shadow, which may be anywhere
    view.at(20, 10) = linear_pixel({0, 0, 0}, {1.5f, 1, 1});      // light that the ball reflects onto a catcher
    EXPECT_EQ(view.violations(), "");
}

TEST(OverlayChecks, FailForNumbersThatAreNoLight) {
    const auto violations_of = [](std::uint16_t LinearPixel::*reserved, int added, int transmittance,
                                  std::uint16_t half) {
        LinearView view;
        LinearPixel &pixel = view.at(330, 235);
        if (reserved)
            pixel.*reserved = half;
        if (added >= 0)
            pixel.added[added] = half;
        if (transmittance >= 0)
            pixel.transmittance[transmittance] = half;
        return view.violations();
    };
    constexpr std::uint16_t nan = 0x7e00, infinity = 0x7c00, minus_one = 0xbc00;
    const std::string place = "raytracer.light: frame 11: pixel (330, 235): value ";
    EXPECT_EQ(violations_of(nullptr, 1, -1, nan), place + "1 is nan; it must be finite and not negative");
    EXPECT_EQ(violations_of(nullptr, -1, 2, infinity), place + "6 is inf; it must be finite and not negative");
    EXPECT_EQ(violations_of(nullptr, 0, -1, minus_one), place + "0 is -1; it must be finite and not negative");
    EXPECT_EQ(violations_of(nullptr, -1, 0, minus_one), place + "4 is -1; it must be finite and not negative");
    EXPECT_EQ(violations_of(&LinearPixel::reserved_0, -1, -1, half_of_one),
              place + "3 is 1, but reserved; it must be 0");
    EXPECT_EQ(violations_of(&LinearPixel::reserved_1, -1, -1, half_of_one),
              place + "7 is 1, but reserved; it must be 0");
}

TEST(OverlayChecks, FailForLightOutsideTheRegionAndTheObjects) {
    LinearView view;
    view.at(100, 50) = linear_pixel({1, 1, 1}, {0, 0, 0});
    EXPECT_EQ(view.violations({300, 200, 60, 70}),
              "raytracer.region: frame 2: pixel (100, 50) is outside the reported region, but changes the video; the "
              "region is 60 x 70 px at (300, 200)");
    EXPECT_EQ(view.violations(), "raytracer.place: frame 2: pixel (100, 50): adds light and hides the video, but all "
                                 "virtual objects are between (297, 201) and (363, 269)");
}

TEST(OverlayChecks, SkipPlacesBehindTheCamera) {
    View view;
    view.camera.eye[1] = -5; // the camera is inside the ball
    view.set(1, 1, 255);
    EXPECT_EQ(view.violations(), "");
}
