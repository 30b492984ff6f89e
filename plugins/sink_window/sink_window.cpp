// SPDX-License-Identifier: Apache-2.0
//
// sink_window: shows frames in a window. Uses the fixed-function pipeline of OpenGL 2.1, which suffices for one
// textured rectangle and is available with every driver.
#include <arhost-cpp/plugin.hpp>

#define GLFW_INCLUDE_GLEXT
#include <GLFW/glfw3.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace {

using namespace arhost;

std::string glfw_reason() {
    const char *reason = nullptr;
    glfwGetError(&reason);
    return reason ? reason : "no reason given";
}

Failure glfw_failure(const std::string &what) {
    return Failure(
        ARHOST_STATUS_ERROR_CONFIGURATION,
        what + ": " + glfw_reason() +
            ". A window needs a desktop (the variable DISPLAY) and OpenGL 2.1: start arhost there, or under "
            "`xvfb-run -a`, or write to a file with sink_video or sink_images instead");
}

class Glfw {
public:
    Glfw() {
        if (!glfwInit())
            throw glfw_failure("cannot open a window");
    }
    ~Glfw() { glfwTerminate(); }
    Glfw(const Glfw &) = delete;
    Glfw &operator=(const Glfw &) = delete;
};

struct DestroyWindow {
    void operator()(GLFWwindow *window) const { glfwDestroyWindow(window); }
};

struct Rectangle {
    int x, y, width, height;
};

// Returns the largest centred rectangle within `width`×`height` that has the aspect ratio of the image.
Rectangle fit(int image_width, int image_height, int width, int height) {
    const double scale =
        std::min(static_cast<double>(width) / image_width, static_cast<double>(height) / image_height);
    const int w = std::max(1, static_cast<int>(std::lround(image_width * scale)));
    const int h = std::max(1, static_cast<int>(std::lround(image_height * scale)));
    return {(width - w) / 2, (height - h) / 2, w, h};
}

class WindowSink {
public:
    // Lists the monitors, or one display with the reason why no window can be opened.
    static std::vector<Device> devices() {
        Device unusable{.kind = ARHOST_DEVICE_DISPLAY,
                        .state = ARHOST_DEVICE_STATE_UNUSABLE,
                        .is_default = true,
                        .name = "desktop"};
        if (!glfwInit()) {
            unusable.problem = glfw_reason();
            return {unusable};
        }
        const Glfw glfw;
        request_context();
        glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);
        if (!std::unique_ptr<GLFWwindow, DestroyWindow>(glfwCreateWindow(1, 1, "", nullptr, nullptr))) {
            unusable.problem = "no OpenGL 2.1: " + glfw_reason();
            return {unusable};
        }
        std::vector<Device> devices;
        int count = 0;
        GLFWmonitor **monitors = glfwGetMonitors(&count);
        for (int i = 0; i < count; ++i) {
            const GLFWvidmode *mode = glfwGetVideoMode(monitors[i]);
            devices.push_back({.index = static_cast<std::uint32_t>(i),
                               .kind = ARHOST_DEVICE_DISPLAY,
                               .is_default = monitors[i] == glfwGetPrimaryMonitor(),
                               .name = glfwGetMonitorName(monitors[i]),
                               .width = static_cast<std::uint32_t>(mode->width),
                               .height = static_cast<std::uint32_t>(mode->height),
                               .rate = static_cast<double>(mode->refreshRate)});
        }
        return devices;
    }

    WindowSink(const Host &, const Options &options)
        : title_(options.text("title")), scale_(options.real("scale")), vsync_(options.boolean("vsync")) {}

    void start(const arhost_sink_setup &setup) {
        width_ = static_cast<int>(setup.width);
        height_ = static_cast<int>(setup.height);
        glfw_.emplace();
        open_window();
        glfwMakeContextCurrent(window_.get());
        glfwSwapInterval(vsync_);
        make_texture();
        draw();
    }

    arhost_status write(const arhost_output &output) {
        upload(output);
        draw();
        return poll();
    }

    arhost_status idle() {
        const arhost_status status = poll();
        if (stale_)
            draw();
        return status;
    }

    void stop() {
        window_.reset();
        glfw_.reset();
    }

private:
    static WindowSink &self(GLFWwindow *window) {
        return *static_cast<WindowSink *>(glfwGetWindowUserPointer(window));
    }

    static void request_context() {
        glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 2);
        glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 1);
    }

    void open_window() {
        request_context();
        glfwWindowHint(GLFW_SCALE_TO_MONITOR, GLFW_TRUE);
        int width = static_cast<int>(std::lround(width_ * scale_)),
            height = static_cast<int>(std::lround(height_ * scale_));
        if (GLFWmonitor *monitor = glfwGetPrimaryMonitor()) {
            Rectangle area{};
            glfwGetMonitorWorkarea(monitor, &area.x, &area.y, &area.width, &area.height);
            if (width > area.width || height > area.height) {
                area = fit(width_, height_, area.width, area.height);
                width = area.width;
                height = area.height;
            }
        }
        window_.reset(glfwCreateWindow(std::max(1, width), std::max(1, height), title_.c_str(), nullptr, nullptr));
        if (!window_)
            throw glfw_failure("cannot open a window");
        glfwSetWindowUserPointer(window_.get(), this);
        glfwSetFramebufferSizeCallback(window_.get(), [](GLFWwindow *w, int, int) { self(w).stale_ = true; });
        glfwSetWindowRefreshCallback(window_.get(), [](GLFWwindow *w) { self(w).stale_ = true; });
        glfwSetKeyCallback(window_.get(), [](GLFWwindow *w, int key, int, int action, int) {
            if (key == GLFW_KEY_ESCAPE && action == GLFW_PRESS)
                glfwSetWindowShouldClose(w, GLFW_TRUE);
        });
        // The character callback delivers letters according to the keyboard layout.
        glfwSetCharCallback(window_.get(), [](GLFWwindow *w, unsigned letter) {
            if (letter == 'q')
                glfwSetWindowShouldClose(w, GLFW_TRUE);
            else if (letter == 'f')
                self(w).toggle_full_screen();
        });
    }

    void make_texture() {
        GLint largest = 0;
        glGetIntegerv(GL_MAX_TEXTURE_SIZE, &largest);
        if (width_ > largest || height_ > largest)
            throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, "OpenGL on this machine supports images of up to " +
                                                               std::to_string(largest) +
                                                               " px per side; use smaller frames");
        GLuint texture = 0; // deleted together with the context
        glGenTextures(1, &texture);
        glBindTexture(GL_TEXTURE_2D, texture);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
        glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
        const std::vector<std::uint8_t> black(3 * static_cast<std::size_t>(width_) *
                                              static_cast<std::size_t>(height_));
        glTexImage2D(GL_TEXTURE_2D, 0, GL_RGB8, width_, height_, 0, GL_BGR, GL_UNSIGNED_BYTE, black.data());
        glEnable(GL_TEXTURE_2D);
        glTexEnvi(GL_TEXTURE_ENV, GL_TEXTURE_ENV_MODE, GL_REPLACE);
        glDisable(GL_DITHER);
    }

    void upload(const arhost_output &output) {
        const std::size_t row_size = 3 * std::size_t{output.width};
        const std::uint8_t *pixels = output.bgr;
        if (output.stride != row_size) { // the stride may not be a multiple of the pixel size, which OpenGL requires
            packed_.resize(row_size * output.height);
            for (std::size_t y = 0; y < output.height; ++y)
                std::memcpy(packed_.data() + y * row_size, output.bgr + y * output.stride, row_size);
            pixels = packed_.data();
        }
        glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, static_cast<GLsizei>(output.width),
                        static_cast<GLsizei>(output.height), GL_BGR, GL_UNSIGNED_BYTE, pixels);
    }

    void draw() {
        stale_ = false;
        int width = 0, height = 0;
        glfwGetFramebufferSize(window_.get(), &width, &height);
        if (width < 1 || height < 1)
            return; // the window is minimised
        glViewport(0, 0, width, height);
        glClear(GL_COLOR_BUFFER_BIT);
        const Rectangle r = fit(width_, height_, width, height);
        glViewport(r.x, height - r.y - r.height, r.width, r.height); // OpenGL has its origin at the bottom
        glBegin(GL_TRIANGLE_STRIP);
        for (const auto &[u, v] : {std::pair{0, 0}, {1, 0}, {0, 1}, {1, 1}}) {
            glTexCoord2i(u, v);
            glVertex2i(2 * u - 1, 1 - 2 * v); // the first row is at the top
        }
        glEnd();
        glfwSwapBuffers(window_.get());
    }

    arhost_status poll() {
        glfwPollEvents();
        return glfwWindowShouldClose(window_.get()) ? ARHOST_STATUS_END : ARHOST_STATUS_OK;
    }

    void toggle_full_screen() {
        stale_ = true;
        GLFWwindow *window = window_.get();
        if (glfwGetWindowMonitor(window)) {
            glfwSetWindowMonitor(window, nullptr, windowed_.x, windowed_.y, windowed_.width, windowed_.height, 0);
            return;
        }
        glfwGetWindowPos(window, &windowed_.x, &windowed_.y);
        glfwGetWindowSize(window, &windowed_.width, &windowed_.height);
        if (GLFWmonitor *monitor = monitor_in_view()) {
            const GLFWvidmode *mode = glfwGetVideoMode(monitor);
            glfwSetWindowMonitor(window, monitor, 0, 0, mode->width, mode->height, mode->refreshRate);
        }
    }

    // Returns the monitor that shows the centre of the window, or the primary monitor.
    GLFWmonitor *monitor_in_view() const {
        const int x = windowed_.x + windowed_.width / 2, y = windowed_.y + windowed_.height / 2;
        int count = 0;
        GLFWmonitor **monitors = glfwGetMonitors(&count);
        for (int i = 0; i < count; ++i) {
            int left = 0, top = 0;
            glfwGetMonitorPos(monitors[i], &left, &top);
            const GLFWvidmode *mode = glfwGetVideoMode(monitors[i]);
            if (x >= left && x < left + mode->width && y >= top && y < top + mode->height)
                return monitors[i];
        }
        return glfwGetPrimaryMonitor();
    }

    std::string title_;
    double scale_;
    bool vsync_;
    int width_ = 0, height_ = 0; // frame size in px
    std::optional<Glfw> glfw_;
    std::unique_ptr<GLFWwindow, DestroyWindow> window_;
    Rectangle windowed_{}; // where the window was before full screen
    bool stale_ = false;
    std::vector<std::uint8_t> packed_;
};

constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_TEXT, "title", "arhost", "Window title."),
    option(ARHOST_OPTION_REAL, "scale", "1", "Initial window size as a multiple of the frame size.", 0.05, 16),
    option(ARHOST_OPTION_BOOL, "vsync", "true", "Synchronize with the display, which avoids tearing."),
};

constexpr const char *needs[] = {"display", nullptr};

constexpr arhost_descriptor descriptor = {
    sizeof(arhost_descriptor),
    ARHOST_KIND_SINK,
    "sink_window",
    "Window",
    "0.1.0",
    "arhost",
    "Apache-2.0",
    "Shows frames in a window.",
    ARHOST_CAPABILITY_REALTIME_SINK,
    std::size(options),
    options,
    needs,
};

} // namespace

ARHOST_SINK(WindowSink, descriptor)
