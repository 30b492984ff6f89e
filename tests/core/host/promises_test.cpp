// SPDX-License-Identifier: Apache-2.0
#include "host/promises.hpp"

#include "camera/lens.hpp"
#include "scene/arena.hpp"

#include <gmock/gmock.h>

#include <cstring>
#include <vector>

using namespace arhost;
using namespace arhost::host;
using testing::HasSubstr;

namespace {

constexpr arhost_intrinsics lens{
    sizeof(arhost_intrinsics), 640, 480, ARHOST_DISTORTION_NONE, 600, 610, 330, 235, 0, 0, {}};
constexpr arhost_marker_config listed[] = {{sizeof(arhost_marker_config), 4, 80},
                                           {sizeof(arhost_marker_config), 7, 40}};

// Seen from the front, half a metre away.
arhost_marker marker(int id, double side_mm) {
    arhost_marker m{};
    m.id = id;
    m.state = ARHOST_MARKER_DETECTED;
    m.mt[0] = m.mt[5] = m.mt[10] = m.mt[15] = 1;
    m.mt[12] = 20;
    m.mt[14] = -500;
    const double s = side_mm / 2, corners[4][2] = {{-s, s}, {s, s}, {s, -s}, {-s, -s}};
    for (int i = 0; i < 4; ++i) {
        const auto at = camera::project(lens, {corners[i][0] + 20, -corners[i][1], 500});
        m.corners_px[i][0] = at->x;
        m.corners_px[i][1] = at->y;
    }
    return m;
}

arhost_record record(std::initializer_list<arhost_marker> markers) {
    arhost_record r{};
    r.sequence = 12;
    for (const arhost_marker &m : markers)
        r.markers[r.marker_count++] = m;
    return r;
}

std::string broken(const Promises &promises) {
    std::string text;
    for (const auto &[name, promise] : promises.all())
        if (promise.broken > 0)
            text += name + ": " + promise.first;
    return text;
}

std::string broken_by(std::initializer_list<arhost_marker> markers) {
    Promises promises;
    look_at_markers(promises, record(markers), lens, listed);
    return broken(promises);
}

constexpr std::int64_t ms = 1'000'000;
struct Time {
    std::int64_t capture_ns;
    std::uint32_t skipped = 0;
};
// Frames from 0 on that come at `now_ns`, of a source that was started at 0.
std::string broken_by_times(const SourcePromises::Rate &rate, arhost_clock clock, const std::vector<Time> &times,
                            std::int64_t now_ns) {
    SourcePromises source(rate, 0);
    Promises promises;
    arhost_record r{};
    r.clock = clock;
    for (const Time &time : times) {
        r.capture_ns = time.capture_ns;
        source.look(promises, r, time.skipped, now_ns);
        ++r.sequence;
    }
    return broken(promises);
}

arhost_marker spoilt(void (*spoil)(arhost_marker &)) {
    arhost_marker m = marker(4, 80);
    spoil(m);
    return m;
}

// A ball of 10 mm radius at the origin, seen from 200 mm in front of it.
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
    arhost_camera camera{sizeof(arhost_camera), 0, {0, -200, 0}, {0, 0, 0}, {0, 0, 1}, lens};
    scene::Arena scene;
    std::vector<std::uint8_t> pixels;

    void set(std::uint32_t x, std::uint32_t y, int alpha) {
        pixels[4 * (640 * y + x) + 3] = static_cast<std::uint8_t>(alpha);
    }
    std::string broken(const Region &region = {0, 0, 640, 480}) const {
        const OverlayPromises overlay(scene.scene());
        Promises promises;
        for (std::uint64_t frame = 0; frame < 16; ++frame) // each row once
            overlay.look(promises, frame, camera, region, {pixels.data(), 640 * 4});
        return ::broken(promises);
    }
};

} // namespace

TEST(Promises, CountFramesAndTellTheFirstThatBreaksThem) {
    std::vector<std::string> told;
    Promises promises(
        [&](const std::string &name, const std::string &sentence) { told.push_back(name + " " + sentence); });
    promises.look("a.b", 1, "");
    promises.look("a.b", 2, "is wrong");
    promises.look("a.b", 3, "is wrong again");
    EXPECT_EQ(promises.all().at("a.b").looked, 3u);
    EXPECT_EQ(promises.all().at("a.b").broken, 2u);
    EXPECT_EQ(promises.all().at("a.b").first, "frame 2: is wrong");
    EXPECT_THAT(told, testing::ElementsAre("a.b frame 2: is wrong"));
}

TEST(MarkerPromises, AreKeptByATrackerThatIsRight) {
    EXPECT_EQ(broken_by({}), "");
    EXPECT_EQ(broken_by({marker(4, 80), marker(7, 40)}), "");
    EXPECT_EQ(broken_by({marker(7, 40)}), "");
    // A tenth of a pixel off, and said to be so.
    EXPECT_EQ(broken_by({spoilt([](arhost_marker &m) {
                  m.corners_px[0][0] += 0.2;
                  m.reprojection_px = 0.1;
              })}),
              "");
    // What is only predicted has no corners to compare with.
    EXPECT_EQ(broken_by({spoilt([](arhost_marker &m) {
                  m.state = ARHOST_MARKER_PREDICTED;
                  m.age_frames = 2;
                  m.mt[12] += 100;
              })}),
              "");
}

TEST(MarkerPromises, AreBrokenByOneThatIsNot) {
    EXPECT_EQ(broken_by({marker(7, 40), marker(4, 80)}),
              "tracker.order: frame 12: marker 4 is not in the order of the configuration's list");
    const auto expect = [](void (*spoil)(arhost_marker &), const char *told) {
        EXPECT_THAT(broken_by({spoilt(spoil)}), HasSubstr(told));
    };
    expect([](arhost_marker &m) { m.ambiguity = 1.5; }, "tracker.numbers: frame 12: marker 4 has the ambiguity 1.5");
    expect([](arhost_marker &m) { m.reprojection_px = -1; }, "which must not be negative");
    expect([](arhost_marker &m) { m.age_frames = 3; }, "marker 4 is seen, and 3 frames old");
    expect([](arhost_marker &m) { m.mt_alternative[0] = 2; }, "marker 4's alternative: the pose's last row");
    expect([](arhost_marker &m) { m.mt[14] = -0.5; },
           "tracker.pose: frame 12: marker 4: its reprojection is told as 0.000 px"); // metres
    expect([](arhost_marker &m) { m.mt[14] = 500; }, "its pose is behind the camera");
    expect([](arhost_marker &m) { m.reprojection_px = 1; }, "its reprojection is told as 1.000 px and is 0.000 px");
    expect([](arhost_marker &m) { m.corners_px[1][0] = 1e200; },
           "its reprojection is told as 0.000 px and is inf px");
    EXPECT_THAT(broken_by({marker(4, 40)}), HasSubstr("its reprojection is told as 0.000 px and is "))
        << "half the side";
}

TEST(SourcePromises, WantATimeBeforeNowAndNotBeforeTheBeginning) {
    const auto captured = [](arhost_clock clock, std::int64_t capture_ns) {
        return broken_by_times({}, clock, {{capture_ns}}, 100'000'000'000);
    };
    EXPECT_EQ(captured(ARHOST_CLOCK_MONOTONIC, 99'990'000'000), "");
    EXPECT_EQ(captured(ARHOST_CLOCK_MONOTONIC, 100'250'000'000),
              "source.capture-time: frame 0: was captured 0.250 s after it came");
    EXPECT_EQ(captured(ARHOST_CLOCK_MONOTONIC, 0), "") << "buffers may be long";
    EXPECT_EQ(captured(ARHOST_CLOCK_MONOTONIC, INT64_MIN), "");
    EXPECT_EQ(captured(ARHOST_CLOCK_MEDIA, 0), "") << "a film's times say nothing of now";
    EXPECT_EQ(captured(ARHOST_CLOCK_MEDIA, -500'000'000),
              "source.capture-time: frame 0: is of -0.500 s, before the beginning");
}

TEST(SourcePromises, WantOneClock) {
    SourcePromises source({}, 0);
    Promises promises;
    for (const arhost_clock clock : {ARHOST_CLOCK_MEDIA, ARHOST_CLOCK_MONOTONIC, ARHOST_CLOCK_MEDIA}) {
        arhost_record r = record({});
        r.clock = clock;
        source.look(promises, r, 0, 0);
    }
    EXPECT_EQ(broken(promises), "source.clock: frame 12: has the clock 1, those before had 2");
    EXPECT_EQ(promises.all().at("source.clock").broken, 1u);
}

TEST(SourcePromises, WantTheRateThatWasAskedFor) {
    const auto asked = [](std::initializer_list<Time> times) {
        return broken_by_times({10, true, false}, ARHOST_CLOCK_MEDIA, times, 0);
    };
    EXPECT_EQ(asked({{0}, {100 * ms}, {200 * ms}}), "");
    EXPECT_EQ(asked({{5000 * ms}, {5100 * ms}}), "") << "it may begin anywhere";
    EXPECT_EQ(asked({{0}, {100 * ms}, {500 * ms, 3}, {600 * ms}}), "") << "the skipped ones are counted";
    EXPECT_EQ(asked({{0}, {100 * ms}, {500 * ms}, {600 * ms}}),
              "source.rate: frame 2: comes 0.400 s after the one before, which at 10 frames a second, 0 of them "
              "skipped, is 0.100 s");
    EXPECT_THAT(asked({{0}, {0}}), HasSubstr("comes 0.000 s after the one before"));
    EXPECT_THAT(asked({{0}, {100 * ms, 1}}), HasSubstr("1 of them skipped, is 0.200 s"));
}

TEST(SourcePromises, LetAFilmsOwnFramesLieWhereTheyLike) {
    EXPECT_EQ(broken_by_times({10, false, false}, ARHOST_CLOCK_MEDIA, {{0}, {1}, {60'000 * ms}}, 0), "");
}

TEST(SourcePromises, WantNoFasterTimeThanTheClocksInModeLive) {
    const auto live = [](std::initializer_list<Time> times) {
        return broken_by_times({10, false, true}, ARHOST_CLOCK_MEDIA, times, 2000 * ms);
    };
    EXPECT_EQ(live({{0}, {100 * ms}, {1000 * ms}}), "");
    EXPECT_EQ(live({{0}, {100 * ms}, {10'000 * ms}}),
              "source.rate: frame 2: is 10.000 s behind the first, and came 2.000 s after the start");
}

TEST(SourcePromises, OfALiveOneAreNotOfItsRate) {
    EXPECT_EQ(broken_by_times({}, ARHOST_CLOCK_MEDIA, {{0}, {1}, {3'600'000 * ms}}, 0), "");
}

TEST(SampleOf, FindsAnyChangeWithinSixteenFrames) {
    std::vector<std::byte> bytes(300'000);
    const auto samples = [&] {
        std::vector<std::size_t> all;
        for (std::uint64_t frame = 0; frame < 16; ++frame)
            all.push_back(sample_of(bytes, frame));
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

TEST(OverlayPromises, AreKeptByARayTracerThatIsRight) {
    View view;
    view.set(330, 235, 255); // the ball's centre
    view.set(330, 206, 90);  // its edge: 10 mm are 30 px
    view.set(10, 10, 153);   // a shadow somewhere else
    EXPECT_EQ(view.broken(), "");
}

TEST(OverlayPromises, AreBrokenOutsideTheRegionAndOffTheObjects) {
    View view;
    view.set(100, 50, 255);
    EXPECT_EQ(
        view.broken({300, 200, 60, 70}),
        "raytracer.region: frame 2: pixel (100, 50): alpha is 255 outside of the region, which is 60 x 70 px from "
        "(300, 200)");
    EXPECT_EQ(view.broken(), "raytracer.place: frame 2: pixel (100, 50): alpha is 255, but all virtual objects are "
                             "between (297, 201) and (363, 269)");
}

TEST(OverlayPromises, KnowThatACatcherIsNoVirtualObject) {
    View view(ARHOST_ROLE_CATCHER);
    view.set(330, 235, 255);
    EXPECT_THAT(view.broken(), HasSubstr("alpha is 255, but there is no virtual object"));
    View empty(std::nullopt);
    empty.set(330, 235, 153);
    EXPECT_EQ(empty.broken(), "");
}

TEST(OverlayPromises, SayNothingOfPlacesBehindTheCamera) {
    View view;
    view.camera.eye[1] = -5; // within the ball
    view.set(1, 1, 255);
    EXPECT_EQ(view.broken(), "");
}
