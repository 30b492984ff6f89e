// SPDX-License-Identifier: Apache-2.0
#include "view/window.hpp"

#include "base/atomic_file.hpp"
#include "base/program.hpp"
#include "base/text.hpp"
#include "view/interruption.hpp"
#include "view/picture.hpp"

#define GLFW_INCLUDE_GLEXT
#include <GLFW/glfw3.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>

namespace arhost::view {
namespace {

using Clock = std::chrono::steady_clock;
constexpr double degrees_per_px = 0.4, degrees_per_key = 5, zoom_per_step = 1.1;

[[noreturn]] void fail(const std::string &what) {
    const char *reason = nullptr;
    glfwGetError(&reason);
    throw base::InvalidInput(what + ": " + (reason ? reason : "no reason given") +
                             "; a window needs a desktop (the variable DISPLAY or WAYLAND_DISPLAY) and OpenGL 2.1. "
                             "Write a picture or a film with --output FILE.png or --output FILE.mp4 instead");
}

struct DestroyWindow {
    void operator()(GLFWwindow *window) const { glfwDestroyWindow(window); }
};

// Everything on the thread of the window.
class Viewer {
public:
    Viewer(const WindowSettings &settings, Loader &loader, Stage stage, const Wanted &first)
        : settings_(settings), first_(first), wanted_(first), plays_(settings.plays),
          duration_s_(stage.scene().duration_s) {
        open();
        fit_to_window();
        live_.emplace(loader, std::move(stage), settings.ray_tracer, settings.options, wanted_);
    }

    void run() {
        auto last = Clock::now();
        while (!glfwWindowShouldClose(window_.get())) {
            glfwWaitEventsTimeout(1.0 / 60);
            throw_if_interrupted();
            const auto now = Clock::now();
            if (plays_ && has_animation())
                wanted_.time_s += std::chrono::duration<double>(now - last).count();
            last = now;
            fit_to_window();
            live_->want(wanted_);
            if (auto picture = live_->take_picture()) {
                picture_ = std::move(*picture);
                is_stale_ = true;
            }
            if (const auto message = live_->take_message())
                show(*message);
            if (!message_.empty() && now > message_end_) {
                message_.clear();
                is_stale_ = true;
            }
            if (std::exchange(is_stale_, false))
                draw();
        }
    }

private:
    static Viewer &self(GLFWwindow *window) { return *static_cast<Viewer *>(glfwGetWindowUserPointer(window)); }
    bool has_animation() const {
        return !wanted_.selection.animation.empty() || (settings_.contents.animations.empty() && duration_s_ > 0);
    }

    void open() {
        glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 2);
        glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 1);
        glfwWindowHint(GLFW_SCALE_TO_MONITOR, GLFW_TRUE);
        const std::string title = base::printable(settings_.file.filename().string()) + " - arhost view";
        window_.reset(glfwCreateWindow(static_cast<int>(first_.lens.width), static_cast<int>(first_.lens.height),
                                       title.c_str(), nullptr, nullptr));
        if (!window_)
            fail("cannot open a window");
        GLFWwindow *window = window_.get();
        glfwSetWindowUserPointer(window, this);
        glfwSetKeyCallback(window, [](GLFWwindow *w, int key, int, int action, int) {
            if (action != GLFW_RELEASE)
                self(w).on_key(key);
        });
        glfwSetCharCallback(window, [](GLFWwindow *w, unsigned character) { self(w).on_character(character); });
        glfwSetScrollCallback(window, [](GLFWwindow *w, double, double steps) {
            self(w).wanted_.orbit.zoom(std::pow(zoom_per_step, -steps));
        });
        glfwSetCursorPosCallback(window, [](GLFWwindow *w, double x, double y) { self(w).on_cursor(x, y); });
        glfwSetWindowRefreshCallback(window, [](GLFWwindow *w) { self(w).is_stale_ = true; });
        glfwMakeContextCurrent(window);
        glfwSwapInterval(1);
    }

    void fit_to_window() {
        int width = 0, height = 0;
        glfwGetFramebufferSize(window_.get(), &width, &height);
        if (width < 16 || height < 16)
            return; // minimised
        is_stale_ |= static_cast<int>(wanted_.lens.width) != width || static_cast<int>(wanted_.lens.height) != height;
        wanted_.lens.width = static_cast<std::uint32_t>(std::min(width, 4096));
        wanted_.lens.height = static_cast<std::uint32_t>(std::min(height, 4096));
    }

    void on_cursor(double x, double y) {
        const double dx = x - cursor_x_, dy = y - cursor_y_;
        cursor_x_ = x;
        cursor_y_ = y;
        int width = 0, height = 0;
        glfwGetWindowSize(window_.get(), &width, &height);
        const auto is_down = [this](int button) { return glfwGetMouseButton(window_.get(), button) == GLFW_PRESS; };
        if (is_down(GLFW_MOUSE_BUTTON_LEFT))
            wanted_.orbit.turn(-dx * degrees_per_px, dy * degrees_per_px);
        else if ((is_down(GLFW_MOUSE_BUTTON_RIGHT) || is_down(GLFW_MOUSE_BUTTON_MIDDLE)) && height > 0)
            wanted_.orbit.pan(dx * wanted_.lens.height / height, dy * wanted_.lens.height / height, wanted_.lens);
    }

    void on_key(int key) {
        switch (key) {
        case GLFW_KEY_LEFT:
            return wanted_.orbit.turn(-degrees_per_key, 0);
        case GLFW_KEY_RIGHT:
            return wanted_.orbit.turn(degrees_per_key, 0);
        case GLFW_KEY_UP:
            return wanted_.orbit.turn(0, degrees_per_key);
        case GLFW_KEY_DOWN:
            return wanted_.orbit.turn(0, -degrees_per_key);
        case GLFW_KEY_ESCAPE:
            return glfwSetWindowShouldClose(window_.get(), GLFW_TRUE);
        default:
            break;
        }
    }

    void on_character(unsigned character) {
        is_stale_ = true;
        switch (character) {
        case '+':
        case '=':
            return wanted_.orbit.zoom(1 / zoom_per_step);
        case '-':
            return wanted_.orbit.zoom(zoom_per_step);
        case ' ':
            plays_ = !plays_;
            return has_animation() ? show(plays_ ? "playing" : "paused") : show("nothing is animated");
        case 'a':
            return choose_animation(1);
        case 'A':
            return choose_animation(-1);
        case 'v':
            return choose_variant();
        case 'n':
            wanted_.shows_normals = !wanted_.shows_normals;
            return show(wanted_.shows_normals ? "normals" : "picture");
        case 'r':
            wanted_.orbit = first_.orbit;
            return;
        case 's':
            return save();
        case 'h':
            shows_help_ = !shows_help_;
            return;
        case 'q':
            return glfwSetWindowShouldClose(window_.get(), GLFW_TRUE);
        default:
            break;
        }
    }

    // In turn: each of the file, all, none.
    void choose_animation(int step) {
        const auto &animations = settings_.contents.animations;
        if (animations.empty())
            return show("the file has no animations to choose from");
        const int count = static_cast<int>(animations.size()) + 2;
        animation_ = (animation_ + step + count) % count;
        const bool is_all = animation_ == count - 2, is_none = animation_ == count - 1;
        wanted_.selection.animation = is_none ? "" : is_all ? "all" : std::to_string(animation_);
        wanted_.time_s = 0;
        show("animation: " +
             (is_none  ? "none"
              : is_all ? "all"
                       : std::to_string(animation_) + " " + animations[static_cast<std::size_t>(animation_)].name));
    }

    void choose_variant() {
        const std::vector<std::string> &variants = settings_.contents.variants;
        if (variants.empty())
            return show("the file has no variants");
        const auto now = std::ranges::find(variants, wanted_.selection.variant);
        const auto next = now == variants.end() ? variants.begin() : now + 1;
        wanted_.selection.variant = next == variants.end() ? "" : *next;
        show("variant: " + (next == variants.end() ? "the file's own materials" : *next));
    }

    // Writes the first free name of "duck-1.png", "duck-2.png", … to the current folder.
    void save() {
        if (picture_.empty())
            return;
        try {
            std::filesystem::path file;
            std::error_code ignored;
            for (int i = 1; file.empty() || std::filesystem::exists(file, ignored); ++i)
                file = settings_.file.stem().string() + "-" + std::to_string(i) + ".png";
            base::AtomicFile(file).write(encoded(picture_, ".png"));
            show("saved " + file.string());
        } catch (const std::exception &error) {
            show(error.what());
        }
    }

    void show(const std::string &text) {
        message_ = base::printable(text, 200);
        message_end_ = Clock::now() + std::chrono::seconds(4);
        is_stale_ = true;
    }

    void draw() {
        int width = 0, height = 0;
        glfwGetFramebufferSize(window_.get(), &width, &height);
        glViewport(0, 0, width, height);
        glClear(GL_COLOR_BUFFER_BIT);
        cv::Mat picture =
            picture_.empty() ? backdrop(Backdrop::grey, std::max(width, 1), std::max(height, 1)) : picture_.clone();
        draw_overlay(picture);
        glBindTexture(GL_TEXTURE_2D, 1);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
        glTexEnvi(GL_TEXTURE_ENV, GL_TEXTURE_ENV_MODE, GL_REPLACE);
        glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
        glTexImage2D(GL_TEXTURE_2D, 0, GL_RGB8, picture.cols, picture.rows, 0, GL_BGR, GL_UNSIGNED_BYTE,
                     picture.data);
        glEnable(GL_TEXTURE_2D);
        // After a change of the window's size, the picture keeps its shape until the next one arrives.
        const float scale = std::min(static_cast<float>(width) / static_cast<float>(picture.cols),
                                     static_cast<float>(height) / static_cast<float>(picture.rows));
        const float x = scale * static_cast<float>(picture.cols) / static_cast<float>(std::max(width, 1)),
                    y = scale * static_cast<float>(picture.rows) / static_cast<float>(std::max(height, 1));
        glBegin(GL_TRIANGLE_STRIP);
        for (const auto &[u, v] : {std::pair(0, 0), {1, 0}, {0, 1}, {1, 1}}) {
            glTexCoord2i(u, v);
            glVertex2f(static_cast<float>(2 * u - 1) * x, static_cast<float>(1 - 2 * v) * y); // first row at the top
        }
        glEnd();
        glfwSwapBuffers(window_.get());
    }

    void draw_overlay(cv::Mat &picture) const {
        const double text_px = std::clamp(picture.rows / 38.0, 11.0, 26.0);
        int line = 0;
        const auto add = [&](const std::string &text) { draw_text(picture, text, text_px, line++); };
        if (picture_.empty())
            add("preparing the ray tracer");
        if (shows_help_) {
            add("left button, arrows: orbit");
            add("wheel, + -: zoom");
            add("right button: pan");
            add("r: first view");
            if (has_animation())
                add("space: pause or play");
            if (!settings_.contents.animations.empty())
                add("a, A: next, previous animation");
            if (!settings_.contents.variants.empty())
                add("v: next variant");
            add("n: normals");
            add("s: save the picture");
            add("q: quit");
        }
        const std::string keys = shows_help_ ? "h: close this help" : "h: help";
        draw_text(picture, message_.empty() ? keys : message_, text_px, -1);
    }

    const WindowSettings &settings_;
    const Wanted first_;
    Wanted wanted_;
    bool plays_, shows_help_ = false, is_stale_ = true;
    int animation_ = 0;
    double cursor_x_ = 0, cursor_y_ = 0;
    float duration_s_;
    std::string message_;
    Clock::time_point message_end_;
    cv::Mat picture_;
    std::unique_ptr<GLFWwindow, DestroyWindow> window_;
    std::optional<LiveView> live_;
};

} // namespace

Display::Display() {
    if (!glfwInit())
        fail("cannot connect to a display");
}

Display::~Display() {
    glfwTerminate();
}

void show_window(const Display &, const WindowSettings &settings, Loader &loader, Stage stage, const Wanted &first) {
    Viewer(settings, loader, std::move(stage), first).run();
}

} // namespace arhost::view
