// SPDX-License-Identifier: Apache-2.0
//
// Runs arhost-view in a window on a virtual X server.
#include "plugin_under_test.hpp"
#include "waiting.hpp"
#include "x_server.hpp"

#include <csignal>
#include <fstream>
#include <functional>
#include <optional>
#include <sys/wait.h>

using namespace arhost::test;

namespace {

namespace fs = std::filesystem;

class ViewWindow : public testing::Test {
protected:
    void SetUp() override {
        if (access(xvfb_path, X_OK) != 0)
            GTEST_SKIP() << "needs Xvfb, which is not installed (Debian package xvfb)";
        server_.emplace(320, 240);
        std::ofstream(scratch_.path() / "model.obj")
            << "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nf 1 2 3\nf 1 3 2\n";
        pid_ = ::fork();
        if (pid_ == 0) {
            setenv("DISPLAY", server_->name().c_str(), 1);
            setenv("LIBGL_ALWAYS_SOFTWARE", "1", 1);
            fs::current_path(scratch_.path());
            const std::string program = build_directory() + "/bin/arhost-view";
            execl(program.c_str(), program.c_str(), "model.obj", "--size", "320x240", nullptr);
            _exit(127);
        }
        observer_.emplace(server_->name());
    }
    void TearDown() override {
        if (pid_ > 0)
            ::kill(pid_, SIGKILL);
        exit_status();
    }
    int exit_status() {
        int status = -1;
        if (pid_ > 0)
            ::waitpid(std::exchange(pid_, -1), &status, 0);
        return status;
    }
    // The mean colour in the middle of the window, without the text at its edges.
    std::array<double, 3> middle() const {
        const Screenshot shot = observer_->screen();
        std::array<double, 3> sum{};
        int count = 0;
        for (int y = 60; y < 180; ++y)
            for (int x = 100; x < 220; ++x, ++count)
                for (std::size_t c = 0; c < 3; ++c)
                    sum[c] += shot.pixel(x, y)[c];
        for (double &c : sum)
            c /= count;
        return sum;
    }
    // The model is red; the colour of its normals, which face the camera, is mainly blue.
    bool shows_picture() const {
        const auto [b, g, r] = middle();
        return r > b + 20;
    }
    bool shows_normals() const {
        const auto [b, g, r] = middle();
        return b > g + 10 && b > r;
    }
    void press(KeySym key) { observer_->press(key); }

    std::optional<XServer> server_;
    std::optional<XObserver> observer_;
    ScratchFolder scratch_;
    pid_t pid_ = -1;
};

} // namespace

TEST_F(ViewWindow, KeysTurnTheCameraAndChangeWhatIsShown) {
    ASSERT_TRUE(eventually([this] { return shows_picture(); }));
    EXPECT_EQ(observer_->title(), "model.obj - arhost view");
    press(XK_n);
    EXPECT_TRUE(eventually([this] { return shows_normals(); }));
    press(XK_n);
    EXPECT_TRUE(eventually([this] { return shows_picture(); }));

    const std::array<double, 3> before = middle();
    for (int i = 0; i < 12; ++i)
        press(XK_Right); // 60°: the triangle is seen from its edge
    EXPECT_TRUE(eventually([&] { return std::abs(middle()[1] - before[1]) > 3; }));
    press(XK_r);
    EXPECT_TRUE(eventually([&] { return std::abs(middle()[1] - before[1]) < 2; }));

    press(XK_s);
    EXPECT_TRUE(eventually([this] { return fs::exists(scratch_.path() / "model-1.png"); }));
    press(XK_q);
    EXPECT_EQ(exit_status(), 0);
}

TEST_F(ViewWindow, EndsWhenItsWindowIsClosed) {
    ASSERT_TRUE(eventually([this] { return shows_picture(); }));
    observer_->close_window();
    EXPECT_EQ(exit_status(), 0);
}
