// SPDX-License-Identifier: Apache-2.0
#include "sink_under_test.hpp"
#include "tracked_record.hpp"
#include "waiting.hpp"
#include "x_server.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <dlfcn.h>
#include <link.h>

#include <algorithm>
#include <array>
#include <functional>

using namespace arhost::test;
using testing::AllOf;
using testing::HasSubstr;

// Suppresses reports about Mesa and Xlib. Their caches live as long as the process and are not leaks of the sink.
extern "C" const char *__lsan_default_suppressions();
extern "C" const char *__lsan_default_suppressions() {
    return "leak:libX11\nleak:libGL\nleak:_dri.so\nleak:libLLVM\nleak:libxcb\n";
}

namespace {

// Keeps the graphics drivers loaded after the window is closed, because suppressions match only libraries that are
// still loaded when leaks are reported.
void keep_libraries() {
    dl_iterate_phdr(
        [](dl_phdr_info *info, std::size_t, void *) {
            dlopen(info->dlpi_name, RTLD_LAZY | RTLD_NOLOAD | RTLD_NODELETE);
            return 0;
        },
        nullptr);
}

constexpr int screen_width = 640, screen_height = 480;

// Returns a bilinear sample of the frame.
double sampled(const Picture &picture, double x, double y, int channel) {
    x = std::clamp(x, 0.0, picture.width() - 1.0);
    y = std::clamp(y, 0.0, picture.height() - 1.0);
    const int x0 = std::min(static_cast<int>(x), picture.width() - 1), x1 = std::min(x0 + 1, picture.width() - 1);
    const int y0 = std::min(static_cast<int>(y), picture.height() - 1), y1 = std::min(y0 + 1, picture.height() - 1);
    const double u = x - x0, v = y - y0;
    return (1 - v) * ((1 - u) * picture.pixel(x0, y0)[channel] + u * picture.pixel(x1, y0)[channel]) +
           v * ((1 - u) * picture.pixel(x0, y1)[channel] + u * picture.pixel(x1, y1)[channel]);
}

// Returns the largest difference between the window and its expected content: the frame in the rectangle `left`,
// `top`, `width`, `height`, and black elsewhere. If the frame is scaled, skips the border pixels of the rectangle,
// whose rounding depends on the driver.
double worst_difference(const Screenshot &shot, const Picture &picture, int left, int top, int width, int height) {
    double worst = 0;
    for (int y = 0; y < shot.height; ++y)
        for (int x = 0; x < shot.width; ++x) {
            const int u = x - left, v = y - top;
            const bool inside = u >= 0 && u < width && v >= 0 && v < height;
            const bool scaled = width != picture.width() || height != picture.height();
            const int edge = scaled ? 1 : 0;
            if (inside && (u < edge || v < edge || u >= width - edge || v >= height - edge))
                continue;
            for (int c = 0; c < 3; ++c) {
                const double wanted = inside ? sampled(picture, (u + 0.5) * picture.width() / width - 0.5,
                                                       (v + 0.5) * picture.height() / height - 0.5, c)
                                             : 0;
                worst = std::max(worst, std::abs(shot.pixel(x, y)[c] - wanted));
            }
        }
    return worst;
}

// Colours of the overlay that the test picture does not contain.
using Bgr = std::array<std::uint8_t, 3>;
constexpr Bgr white{255, 255, 255}, yellow{60, 210, 255}, pink{220, 120, 255}, red{80, 96, 255}, axis_x = red,
                                                                                                 axis_y{110, 230, 90};

bool is(const Screenshot &shot, const Bgr &colour, int x, int y) {
    return std::equal(colour.begin(), colour.end(), shot.pixel(x, y));
}

struct Area {
    int left, top, right, bottom, count;
};

class SinkWindow : public testing::Test {
protected:
    void SetUp() override {
        if (access(xvfb_path, X_OK) != 0)
            GTEST_SKIP() << "needs Xvfb, which is not installed (Debian package xvfb)";
        server_.emplace(screen_width, screen_height);
        setenv("DISPLAY", server_->name().c_str(), 1);
        setenv("LIBGL_ALWAYS_SOFTWARE", "1", 1);
        observer_.emplace(server_->name());
    }
    void TearDown() override {
        sink_.reset(); // before the server, because Xlib terminates a client's process when the connection is lost
        observer_.reset();
        server_.reset();
    }
    SinkUnderTest &start(int width, int height, std::map<std::string, std::string> options = {}) {
        options.try_emplace("status_line", "false"); // covers a part of the frame
        sink_.emplace("sink_window", options);
        EXPECT_EQ(sink_->start(width, height), ARHOST_STATUS_OK) << sink_->log();
        keep_libraries();
        return *sink_;
    }
    // Calls the sink's idle() until `done` returns true; returns whether it does.
    bool becomes(const std::function<bool()> &done) {
        return eventually([&] { return done() || (sink_->idle(), false); });
    }
    // Starts the sink and shows a frame of this size in it.
    SinkUnderTest &show(const Picture &picture, const std::map<std::string, std::string> &options = {}) {
        SinkUnderTest &sink = start(picture.width(), picture.height(), options);
        EXPECT_EQ(sink.write(picture, make_record(0)), ARHOST_STATUS_OK) << sink.log();
        return sink;
    }
    // Waits until the window shows the frame in this rectangle, except for `covered` rows at the bottom; returns the
    // last worst_difference().
    double difference(const Picture &picture, int left, int top, int width, int height, int covered = 0) {
        double worst = 255;
        becomes([&] {
            Screenshot shot = observer_->window();
            shot.height -= covered;
            return (worst = worst_difference(shot, picture, left, top, width, height)) <= 2;
        });
        return worst;
    }
    // Checks that the window shows exactly the frame.
    void expect_shown(const Picture &picture) {
        EXPECT_LE(difference(picture, 0, 0, picture.width(), picture.height()), 2);
    }
    // Returns the bounding box of the pixels that differ from a former screenshot, and their number.
    Area changed_area(const Screenshot &before) const {
        const Screenshot shot = observer_->window();
        Area area{shot.width, shot.height, -1, -1, 0};
        for (int y = 0; y < shot.height; ++y)
            for (int x = 0; x < shot.width; ++x)
                if (!std::equal(shot.pixel(x, y), shot.pixel(x, y) + 3, before.pixel(x, y))) {
                    area = {std::min(area.left, x), std::min(area.top, y), std::max(area.right, x),
                            std::max(area.bottom, y), area.count + 1};
                }
        return area;
    }
    // Returns the number of pixels with this colour.
    int count(const Bgr &colour) const {
        const Screenshot shot = observer_->window();
        int count = 0;
        for (int y = 0; y < shot.height; ++y)
            for (int x = 0; x < shot.width; ++x)
                count += is(shot, colour, x, y);
        return count;
    }

    std::optional<XServer> server_;
    std::optional<XObserver> observer_;
    std::optional<SinkUnderTest> sink_;
};

} // namespace

TEST_F(SinkWindow, ShowsEachFramePixelForPixel) {
    SinkUnderTest &sink = start(320, 200, {{"title", "a title"}});
    EXPECT_EQ(observer_->title(), "a title");
    for (const std::uint64_t i : {0, 300}) {
        const Picture picture(320, 200, i);
        ASSERT_EQ(sink.write(picture, make_record(i)), ARHOST_STATUS_OK) << sink.log();
        expect_shown(picture);
    }
    const Screenshot shot =
        observer_->screen(); // the frame must be visible on the screen, not only in the window's buffer
    const XWindowAttributes where = observer_->attributes();
    const Picture picture(320, 200, 300);
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(shot.pixel(where.x + 160, where.y + 100)[c], picture.pixel(160, 100)[c], 2);
    EXPECT_EQ(sink.stop(), ARHOST_STATUS_OK);
}

TEST_F(SinkWindow, ShowsTheOverlayAloneOverBlack) {
    constexpr std::uint32_t width = 120, height = 90;
    SinkUnderTest &sink = start(width, height, {{"content", "overlay"}});
    EXPECT_EQ(sink.capabilities(), ARHOST_SINK_CAPABILITY_REALTIME | ARHOST_SINK_CAPABILITY_OVERLAY_INPUT);
    OverlayPicture overlay(width, height);
    ASSERT_EQ(sink.write(Picture(width, height, 0), make_record(0), &overlay), ARHOST_STATUS_OK) << sink.log();
    double worst = 255;
    becomes([&] {
        const Screenshot shot = observer_->window();
        worst = 0;
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                for (int channel = 0; channel < 3; ++channel) {
                    const std::uint8_t *const rgba = overlay.pixel(x, y);
                    const double expected = rgba[2 - channel] * rgba[3] / 255.0;
                    const int actual = shot.pixel(static_cast<int>(x), static_cast<int>(y))[channel];
                    worst = std::max(worst, std::abs(actual - expected));
                }
        return worst <= 2;
    });
    EXPECT_LE(worst, 2);
}

TEST_F(SinkWindow, AcceptsOddSizesAndPaddedRows) {
    for (const auto &[width, height] : {std::pair{131, 97}, {130, 33}}) {
        SinkUnderTest &sink = start(width, height);
        const Picture picture(width, height, 9, 3 * width + 61);
        ASSERT_EQ(sink.write(picture, make_record(0)), ARHOST_STATUS_OK);
        EXPECT_LE(difference(picture, 0, 0, width, height), 2);
    }
}

TEST_F(SinkWindow, IsBlackUntilTheFirstFrame) {
    start(160, 120);
    EXPECT_TRUE(becomes([&] {
        const Screenshot shot = observer_->window();
        return std::ranges::all_of(shot.bgr, [](std::uint8_t v) { return v == 0; });
    }));
}

TEST_F(SinkWindow, KeepsTheAspectRatioWhenResized) {
    const Picture picture(160, 120, 0);
    show(picture);
    observer_->resize(400, 240); // wider than the frame, which gives bars at the sides
    EXPECT_LE(difference(picture, 40, 0, 320, 240), 2);
    observer_->resize(160, 400); // higher than the frame, which gives bars above and below
    EXPECT_LE(difference(picture, 0, 140, 160, 120), 2);
}

TEST_F(SinkWindow, StartsAtTheConfiguredScale) {
    const Picture picture(160, 120, 0);
    show(picture, {{"scale", "2.5"}});
    const XWindowAttributes window = observer_->attributes();
    EXPECT_EQ(window.width, 400);
    EXPECT_EQ(window.height, 300);
    EXPECT_LE(difference(picture, 0, 0, 400, 300), 2);
}

TEST_F(SinkWindow, IsNeverLargerThanTheScreen) {
    start(1920, 1080);
    const XWindowAttributes window = observer_->attributes();
    EXPECT_EQ(window.width, screen_width);
    EXPECT_EQ(window.height, screen_width * 1080 / 1920);
}

TEST_F(SinkWindow, EscapeAndQEndTheRun) {
    for (const KeySym key : {XK_Escape, XK_q}) {
        SinkUnderTest &sink = start(160, 120);
        EXPECT_EQ(sink.idle(), ARHOST_STATUS_OK);
        observer_->press(XK_a);
        EXPECT_EQ(sink.idle(), ARHOST_STATUS_OK);
        observer_->press(key);
        EXPECT_TRUE(becomes([&] { return sink.idle() == ARHOST_STATUS_END; }));
        EXPECT_EQ(sink.write(Picture(160, 120, 0), make_record(0)), ARHOST_STATUS_END);
        EXPECT_EQ(sink.stop(), ARHOST_STATUS_OK);
    }
}

TEST_F(SinkWindow, ClosingTheWindowEndsTheRun) {
    SinkUnderTest &sink = start(160, 120);
    EXPECT_EQ(sink.write(0), ARHOST_STATUS_OK);
    observer_->close_window();
    EXPECT_TRUE(becomes([&] { return sink.idle() == ARHOST_STATUS_END; }));
}

TEST_F(SinkWindow, FTogglesFullScreen) {
    const Picture picture(160, 120, 0);
    show(picture);
    const auto has_size = [&](int width, int height) {
        return [this, width, height] {
            const XWindowAttributes window = observer_->attributes();
            return window.width == width && window.height == height;
        };
    };
    observer_->press(XK_f);
    ASSERT_TRUE(becomes(has_size(screen_width, screen_height)));
    EXPECT_LE(difference(picture, 0, 0, screen_width, screen_height), 2);
    observer_->press(XK_f);
    ASSERT_TRUE(becomes(has_size(160, 120)));
    expect_shown(picture);
}

TEST_F(SinkWindow, MMirrorsTheFrameExactly) {
    const Picture picture(320, 200, 5);
    show(picture);
    expect_shown(picture);
    const Screenshot before = observer_->window();
    const auto is_mirrored = [&] {
        const Screenshot shot = observer_->window();
        for (int y = 0; y < 200; ++y)
            for (int x = 0; x < 320; ++x)
                if (!std::equal(shot.pixel(x, y), shot.pixel(x, y) + 3, before.pixel(319 - x, y)))
                    return false;
        return true;
    };
    observer_->press(XK_m);
    EXPECT_TRUE(becomes(is_mirrored));
    observer_->press(XK_m);
    expect_shown(picture);
}

TEST_F(SinkWindow, HShowsAHelpInTheMiddleOfTheWindow) {
    const Picture picture(640, 480, 5);
    show(picture);
    expect_shown(picture);
    const Screenshot before = observer_->window();
    observer_->press(XK_h);
    ASSERT_TRUE(becomes([&] { return changed_area(before).count > 0; }));
    const Area help = changed_area(before);
    EXPECT_NEAR(help.left + help.right, 639, 4);
    EXPECT_NEAR(help.top + help.bottom, 479, 4);
    EXPECT_GT(help.right - help.left, 150);
    EXPECT_GT(help.bottom - help.top, 200);
    EXPECT_GT(count(white), 500) << "text";
    observer_->press(XK_h);
    expect_shown(picture);
}

TEST_F(SinkWindow, TheStatusLineIsAtTheBottom) {
    const Picture picture(640, 480, 5);
    show(picture, {{"status_line", "true"}});
    EXPECT_LE(difference(picture, 0, 0, 640, 480, 40), 2);
    EXPECT_GT(count(white), 200);
}

TEST_F(SinkWindow, AHeldKeyCountsOnce) {
    const Picture picture(320, 200, 5);
    show(picture);
    expect_shown(picture);
    const Screenshot before = observer_->window();
    observer_->press(XK_h, 4);
    EXPECT_TRUE(becomes([&] { return changed_area(before).count > 0; }));
}

TEST_F(SinkWindow, AKeyForTheHostShowsAMessageIfTheHostTakesNoCommands) {
    for (const KeySym key : {XK_s, XK_space, XK_r, XK_1}) {
        SinkUnderTest &sink = start(320, 200);
        ASSERT_EQ(sink.write(Picture(320, 200, 5), make_record(0)), ARHOST_STATUS_OK);
        EXPECT_EQ(count(red), 0);
        observer_->press(key);
        EXPECT_TRUE(becomes([&] { return count(red) > 100; })) << key;
    }
}

TEST_F(SinkWindow, DShowsMarkersAndAxesOfTargetsWhereTheyAre) {
    SinkUnderTest &sink = start(640, 480);
    const double corners[4][2] = {{200, 150}, {300, 160}, {310, 260}, {190, 250}};
    const double other_corners[4][2] = {{420, 300}, {500, 300}, {500, 380}, {420, 380}};
    // Returns the position at a distance of 500 mm that is seen at this pixel.
    const auto seen_at = [](double x, double y) -> std::array<double, 3> {
        const arhost_intrinsics lens = make_intrinsics(640, 480);
        return {(x - lens.cx) / lens.fx * 500, -(y - lens.cy) / lens.fy * 500, -500};
    };
    const Picture picture(640, 480, 5);
    {
        TrackedRecord record{make_record(0), {}, {}};
        record.add_target("cup", ARHOST_TARGET_DETECTED, seen_at(250, 205));
        record.add_observation(23, corners);
        record.add_target("gone", ARHOST_TARGET_LOST, seen_at(330, 350)); // is not drawn
        record.add_target("head", ARHOST_TARGET_PREDICTED, seen_at(560, 260));
        record.add_observation(24, other_corners, false);
        ASSERT_EQ(sink.write(picture, record), ARHOST_STATUS_OK);
    } // the sink must not read the record later
    expect_shown(picture);
    EXPECT_EQ(count(yellow), 0);
    observer_->press(XK_d);
    ASSERT_TRUE(becomes([&] { return count(yellow) > 0; }));
    for (const bool mirrored : {false, true}) {
        const Screenshot shot = observer_->window();
        const auto shows = [&](const Bgr &colour, double x, double y) {
            return is(shot, colour, static_cast<int>(mirrored ? 639 - x : x), static_cast<int>(y));
        };
        for (const bool is_listed : {true, false})
            for (int i = 0; i < 4; ++i) { // at each corner and in the middle of each edge
                const auto &quad = is_listed ? corners : other_corners;
                const double *a = quad[i], *b = quad[(i + 1) % 4];
                EXPECT_TRUE(shows(is_listed ? yellow : pink, a[0], a[1])) << i;
                EXPECT_TRUE(shows(is_listed ? yellow : pink, (a[0] + b[0]) / 2, (a[1] + b[1]) / 2)) << i;
            }
        // The stroke at the first corner, from 0.4 of the first edge to 0.2 of the last one.
        EXPECT_TRUE(shows(pink, 436, 308));
        EXPECT_FALSE(shows(pink, 428, 316)) << "would be the mark of the opposite order";
        EXPECT_TRUE(shows(axis_x, 265, 205)) << "x points to the right";
        EXPECT_TRUE(shows(axis_y, 250, 195)) << "y points upwards";
        EXPECT_TRUE(shows(axis_y, 566, 250)) << "of a target without markers, where the lens shows it";
        EXPECT_FALSE(shows(axis_x, 345, 350)) << "of a lost target";
        if (mirrored)
            break;
        observer_->press(XK_m);
        ASSERT_TRUE(becomes([&] { return is(observer_->window(), yellow, 639 - 200, 150); }));
    }
    observer_->press(XK_m);
    observer_->press(XK_d);
    expect_shown(picture);
}

TEST_F(SinkWindow, AnOptionShowsTheDebugViewAtOnce) {
    SinkUnderTest &sink = start(640, 480, {{"debug_view", "true"}});
    ASSERT_EQ(sink.write(Picture(640, 480, 5), make_record(0)), ARHOST_STATUS_OK);
    EXPECT_TRUE(becomes([&] { return count(yellow) > 0; })) << "the label of the first row";
    observer_->press(XK_d);
    EXPECT_TRUE(becomes([&] { return count(yellow) == 0; }));
}

TEST_F(SinkWindow, CanBeReopened) {
    for (int i = 0; i < 2; ++i) {
        SinkUnderTest &sink = start(160, 120);
        EXPECT_EQ(sink.write(0), ARHOST_STATUS_OK);
        EXPECT_EQ(sink.stop(), ARHOST_STATUS_OK);
    }
}

namespace {

// Returns the devices of the sink as "name width×height problem".
std::vector<std::string> listed_displays() {
    const PluginUnderTest plugin("sink_window");
    const auto *devices = static_cast<const arhost_devices *>(plugin.extension(ARHOST_DEVICES_EXTENSION));
    std::vector<std::string> listed;
    const auto take = [](void *context, const arhost_device *d) {
        EXPECT_EQ(d->kind, ARHOST_DEVICE_DISPLAY);
        static_cast<std::vector<std::string> *>(context)->push_back(
            std::string(d->name) + " " + std::to_string(d->width) + "×" + std::to_string(d->height) + " " +
            (d->problem ? d->problem : "usable"));
    };
    EXPECT_EQ(devices->list(plugin.host(), take, &listed), ARHOST_STATUS_OK);
    return listed;
}

} // namespace

TEST_F(SinkWindow, ListsTheScreen) {
    keep_libraries();
    EXPECT_THAT(listed_displays(), testing::ElementsAre("screen 640×480 usable"));
    EXPECT_THAT(listed_displays(), testing::ElementsAre("screen 640×480 usable"));
}

// In a worker, whose sandbox has a socket of the X server only with the permission `display`.
TEST_F(SinkWindow, HasAScreenThatTheHostLists) {
#if defined(__SANITIZE_ADDRESS__)
    GTEST_SKIP() << "the leak checker would report leaks of OpenGL drivers, and arhost would fail";
#endif
    const std::string text = output_of(arhost::test::build_directory() + "/bin/arhost devices sink_window 2>&1");
    EXPECT_THAT(text, HasSubstr("display: screen, 640×480 [sink_window]\n"));
}

TEST_F(SinkWindow, ListsAScreenWithoutOpenGlAsUnusable) {
    const XServer server(screen_width, screen_height, false);
    setenv("DISPLAY", server.name().c_str(), 1);
    EXPECT_THAT(listed_displays(), testing::ElementsAre(testing::StartsWith("desktop 0×0 no OpenGL 2.1: ")));
}

TEST(SinkWindowWithoutScreen, ListsADisplayWithItsProblem) {
    unsetenv("DISPLAY");
    EXPECT_THAT(listed_displays(),
                testing::ElementsAre(AllOf(testing::StartsWith("desktop 0×0 "), HasSubstr("DISPLAY"))));
}

TEST(SinkWindowWithoutScreen, NamesWhatIsMissingAndWhatToTry) {
    for (const char *display : {"", ":54321"}) {
        setenv("DISPLAY", display, 1);
        SinkUnderTest sink("sink_window", {});
        EXPECT_EQ(sink.start(160, 120), ARHOST_STATUS_ERROR_CONFIGURATION);
        EXPECT_THAT(sink.log(), AllOf(HasSubstr("5 cannot open a window: X11:"), HasSubstr("DISPLAY"),
                                      HasSubstr("xvfb-run -a"), HasSubstr("sink_video")));
    }
}

TEST(SinkWindowWithoutScreen, DeclaresDisplayNeedsAndRealtimeCapability) {
    const SinkUnderTest sink("sink_window", {});
    EXPECT_EQ(sink.descriptor().capabilities, ARHOST_SINK_CAPABILITY_REALTIME | ARHOST_SINK_CAPABILITY_OVERLAY_INPUT);
    EXPECT_EQ(sink.capabilities(), std::uint64_t{ARHOST_SINK_CAPABILITY_REALTIME}) << "a frame needs no overlay";
    EXPECT_NE(sink.functions().idle, nullptr);
}
