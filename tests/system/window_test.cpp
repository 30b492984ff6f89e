// SPDX-License-Identifier: Apache-2.0
//
// Tests of the keys of sink_window, which send commands to the host (docs/control.md).
#include "arhost_run.hpp"
#include "x_server.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <optional>
#include <span>

using namespace arhost::test;

namespace {

// Colours of text.
constexpr std::array<std::uint8_t, 3> red{80, 96, 255}, blue{255, 160, 90}, yellow{60, 210, 255}, grey{170, 170, 170};

// Runs arhost with a window on its own X server.
class WindowRun : public testing::Test {
protected:
    void SetUp() override {
        if (access(xvfb_path, X_OK) != 0)
            GTEST_SKIP() << "needs Xvfb, which is not installed (Debian package xvfb)";
        server_.emplace(640, 480);
    }

    // `granted`: the value of `control`. Frames of source_counter have one colour, which changes from frame to frame.
    void start(const std::string &granted, const std::string &size = "width: 640, height: 480",
               const std::string &record = "{plugin: sink_poses, path: out/take-%02d.jsonl}") {
        std::string yaml = counting({.mode = "live", .source = "frames: 1000000, " + size});
        const std::string counter = "outputs: [{plugin: sink_counter, path: counted.txt}]";
        yaml.replace(yaml.find(counter), counter.size(),
                     "outputs: [{plugin: sink_window, allow: [display], control: " + granted +
                         "}]\nsnapshot: {plugin: sink_images, path: out/snapshot-%02d.png}\n"
                         "record: " +
                         record + "\nscenes: [other.yaml]");
        run_.write("run.yaml", yaml);
        run_.write("scene.yaml", small_scene);
        run_.write("other.yaml", small_scene);
        run_.start({"--config", "run.yaml"}, environment());
        observer_.emplace(server_->name());
        ASSERT_TRUE(eventually([this] { return has_frame(screen()); })) << run_.output();
    }
    std::function<void()> environment() const {
        return [this] {
            setenv("DISPLAY", server_->name().c_str(), 1);
            setenv("LIBGL_ALWAYS_SOFTWARE", "1", 1);
        };
    }
    Screenshot screen() const { return observer_->screen(); }
    static bool has_frame(const Screenshot &shot) { return shot.pixel(0, 100)[2] > 0; }
    // Returns the number of pixels on the screen with this colour of text.
    int count(const std::array<std::uint8_t, 3> &bgr) const {
        const Screenshot shot = screen();
        int count = 0;
        for (int y = 0; y < shot.height; ++y)
            for (int x = 0; x < shot.width; ++x)
                count += std::equal(bgr.begin(), bgr.end(), shot.pixel(x, y));
        return count;
    }
    bool logs(const std::string &text) const { return run_.output().find(text) != std::string::npos; }
    // Whether the video changes while the source delivers several frames. It waits at least once before each frame.
    bool moves() const {
        const Screenshot before = screen();
        const pid_t source = run_.worker("source_counter");
        const std::uint64_t goal = waits_of(source) + 40;
        bool changed = false;
        EXPECT_TRUE(eventually([&] {
            changed = !std::ranges::equal(std::span(screen().pixel(0, 240), 3), std::span(before.pixel(0, 240), 3));
            return changed || waits_of(source) >= goal;
        })) << run_.output();
        return changed;
    }

    std::optional<XServer> server_;
    std::optional<XObserver> observer_;
    ArhostRun run_;
};

constexpr const char *all_commands = "[quit, freeze, snapshot, record, load_scene, status]";

} // namespace

TEST_F(WindowRun, SpaceFreezesTheVideoAndContinuesIt) {
    start(all_commands);
    ASSERT_TRUE(eventually([this] { return moves(); }));
    observer_->press(XK_space);
    ASSERT_TRUE(eventually([this] { return count(blue) > 0; })) << "FROZEN is blue: " << run_.output();
    EXPECT_TRUE(eventually([this] { return !moves(); }));
    observer_->press(XK_space);
    EXPECT_TRUE(eventually([this] { return moves() && count(blue) == 0; })) << run_.output();
    observer_->press(XK_q);
    EXPECT_EQ(run_.wait(), 0) << run_.output();
}

TEST_F(WindowRun, SWritesASnapshot) {
    start(all_commands);
    observer_->press(XK_s);
    EXPECT_TRUE(eventually([this] { return run_.exists("out/snapshot-01.png"); })) << run_.output();
    EXPECT_EQ(count(red), 0);
    observer_->press(XK_q);
    EXPECT_EQ(run_.wait(), 0) << run_.output();
}

TEST_F(WindowRun, RRecordsUntilItIsPressedAgain) {
    start(all_commands);
    observer_->press(XK_r);
    ASSERT_TRUE(eventually([this] { return count(red) > 0; })) << "REC is red: " << run_.output();
    observer_->press(XK_r);
    EXPECT_TRUE(eventually([this] { return count(red) == 0; })) << run_.output();
    EXPECT_TRUE(run_.exists("out/take-01.jsonl"));
    observer_->press(XK_q);
    EXPECT_EQ(run_.wait(), 0) << run_.output();
}

TEST_F(WindowRun, ADigitLoadsTheSceneWithThisNumber) {
    start(all_commands);
    ASSERT_TRUE(eventually([this] {
        observer_->press(XK_2); // reports an error until the first status has arrived
        return logs(R"("scene":"other")");
    })) << run_.output();
    EXPECT_TRUE(eventually([this] { return logs("raytracer is now rt_counter"); })) << run_.output();
    observer_->press(XK_q);
    EXPECT_EQ(run_.wait(), 0) << run_.output();
}

TEST_F(WindowRun, ACommandThatIsNotGrantedShowsTheReason) {
    start("[quit]");
    EXPECT_EQ(count(red), 0) << "the window shows no error about the status";
    observer_->press(XK_space);
    EXPECT_TRUE(eventually([this] { return count(red) > 100; })) << run_.output();
    EXPECT_TRUE(moves());
    EXPECT_TRUE(eventually([this] { return count(red) == 0; })) << "the message disappears";
    observer_->press(XK_2);
    EXPECT_TRUE(eventually([this] { return count(red) > 100; })) << "the names of scenes are unknown";
    observer_->press(XK_q);
    EXPECT_EQ(run_.wait(), 0) << run_.output();
}

TEST_F(WindowRun, TheHelpListsOnlyKeysThatHaveAnEffect) {
    // Waits until the number of yellow pixels, the colour of the keys' names in the help, is constant and less than
    // `limit`; until the answer about the grants has arrived, the help lists all keys. Returns the number.
    const auto keys = [&](const std::string &granted, int limit) {
        start(granted);
        observer_->press(XK_h);
        int last = -1, now = 0;
        EXPECT_TRUE(eventually([&] {
            now = count(yellow);
            return std::exchange(last, now) == now && now > 0 && now < limit && moves();
        })) << now
            << " yellow pixels, limit " << limit;
        observer_->press(XK_q);
        EXPECT_EQ(run_.wait(), 0) << run_.output();
        return now;
    };
    const int many = keys(all_commands, std::numeric_limits<int>::max());
    keys("[quit]", many * 2 / 3);
}

TEST_F(WindowRun, ShowsAnErrorOfTheRun) {
    start(all_commands, "width: 640, height: 480", "{plugin: sink_realtime, path: out/take-%02d.txt}");
    observer_->press(XK_r);
    ASSERT_TRUE(eventually([this] { return run_.worker("sink_realtime") != 0 && count(red) > 0; })) << "REC is red";
    constexpr int misbehave_error = 5; // MISBEHAVE_ERROR in plugins/misbehave.h
    ASSERT_EQ(::sigqueue(run_.worker("sink_realtime"), SIGRTMIN, {.sival_int = misbehave_error}), 0);
    EXPECT_TRUE(eventually([this] { return count(red) > 300; })) << "the error is longer than REC: " << run_.output();
    EXPECT_TRUE(eventually([this] { return count(red) == 0; })) << "the message disappears";
    observer_->press(XK_l);
    EXPECT_TRUE(eventually([this] { return count(red) > 300; })) << "the list has the error";
    observer_->press(XK_q);
    EXPECT_EQ(run_.wait(), 1) << run_.output();
}

TEST_F(WindowRun, TheStatusLineFitsIntoASmallWindow) {
    start(all_commands, "width: 320, height: 240");
    EXPECT_TRUE(eventually([this] { return count(grey) > 0; })) << "the text at the right end has room";
    observer_->press(XK_q);
    EXPECT_EQ(run_.wait(), 0) << run_.output();
}

TEST_F(WindowRun, ShowsAFilmAtItsOwnRateInLockstep) {
    std::string yaml = counting({.source = "frames: 10", .more = "timeline: times.csv\n"});
    const std::string counter = "{plugin: sink_counter, path: counted.txt}";
    run_.write("run.yaml",
               yaml.replace(yaml.find(counter), counter.size(), "{plugin: sink_window, allow: [display]}"));
    run_.write("scene.yaml", small_scene);
    run_.start({"--config", "run.yaml", "--set", "source.fps=20"}, environment());
    ASSERT_EQ(run_.wait(), 0) << run_.output();
    const std::vector<double> shown = shown_seconds(run_.read("times.csv"));
    ASSERT_EQ(shown.size(), 10u);
    for (std::size_t i = 0; i < shown.size(); ++i)
        EXPECT_GE(shown[i], static_cast<double>(i) / 20);
}
