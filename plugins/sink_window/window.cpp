// SPDX-License-Identifier: Apache-2.0
#include "window.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <utility>

namespace sink_window {
namespace {

std::string glfw_reason() {
    const char *reason = nullptr;
    glfwGetError(&reason);
    return reason ? reason : "no reason given";
}

arhost::Failure glfw_failure(const std::string &what) {
    return arhost::Failure(
        ARHOST_STATUS_ERROR_CONFIGURATION,
        what + ": " + glfw_reason() +
            ". A window needs a desktop (the variable DISPLAY) and OpenGL 2.1: start arhost there, or under "
            "`xvfb-run -a`, or write to a file with sink_video or sink_images instead");
}

void request_context() {
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 2);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 1);
}

} // namespace

std::vector<arhost::Device> list_displays() {
    arhost::Device unusable{
        .kind = ARHOST_DEVICE_DISPLAY, .state = ARHOST_DEVICE_STATE_UNUSABLE, .is_default = true, .name = "desktop"};
    if (!glfwInit()) {
        unusable.problem = glfw_reason();
        return {unusable};
    }
    const Glfw glfw;
    request_context();
    glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);
    if (!WindowPointer(glfwCreateWindow(1, 1, "", nullptr, nullptr))) {
        unusable.problem = "no OpenGL 2.1: " + glfw_reason();
        return {unusable};
    }
    std::vector<arhost::Device> devices;
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

Rectangle fit(int image_width, int image_height, int width, int height) {
    const double scale =
        std::min(static_cast<double>(width) / image_width, static_cast<double>(height) / image_height);
    const int w = std::max(1, static_cast<int>(std::lround(image_width * scale)));
    const int h = std::max(1, static_cast<int>(std::lround(image_height * scale)));
    return {(width - w) / 2, (height - h) / 2, w, h};
}

Glfw::Glfw() {
    if (!glfwInit())
        throw glfw_failure("cannot open a window");
}

Glfw::~Glfw() {
    glfwTerminate();
}

Window::Window(int width, int height, double scale, bool vsync, const std::string &title, OnCharacter on_character)
    : on_character_(std::move(on_character)) {
    request_context();
    glfwWindowHint(GLFW_SCALE_TO_MONITOR, GLFW_TRUE);
    Rectangle area{0, 0, static_cast<int>(std::lround(width * scale)), static_cast<int>(std::lround(height * scale))};
    if (GLFWmonitor *monitor = glfwGetPrimaryMonitor()) {
        Rectangle work{};
        glfwGetMonitorWorkarea(monitor, &work.x, &work.y, &work.width, &work.height);
        if (area.width > work.width || area.height > work.height)
            area = fit(width, height, work.width, work.height);
    }
    window_.reset(
        glfwCreateWindow(std::max(1, area.width), std::max(1, area.height), title.c_str(), nullptr, nullptr));
    if (!window_)
        throw glfw_failure("cannot open a window");
    glfwSetWindowUserPointer(window_.get(), this);
    glfwSetFramebufferSizeCallback(window_.get(), [](GLFWwindow *w, int, int) { self(w).stale_ = true; });
    glfwSetWindowRefreshCallback(window_.get(), [](GLFWwindow *w) { self(w).stale_ = true; });
    glfwSetKeyCallback(window_.get(), [](GLFWwindow *w, int key, int, int action, int) {
        self(w).key_repeats_ = action == GLFW_REPEAT;
        if (key == GLFW_KEY_ESCAPE && action == GLFW_PRESS)
            self(w).close();
    });
    glfwSetCharCallback(window_.get(), [](GLFWwindow *w, unsigned character) {
        if (character < 128 && !self(w).key_repeats_)
            self(w).on_character_(static_cast<char>(std::tolower(static_cast<int>(character))));
    });
    glfwMakeContextCurrent(window_.get());
    glfwSwapInterval(vsync);
}

void Window::process_events() {
    glfwPollEvents();
}

void Window::close() {
    glfwSetWindowShouldClose(window_.get(), GLFW_TRUE);
}

bool Window::closed() const {
    return glfwWindowShouldClose(window_.get()) != 0;
}

Rectangle Window::size() const {
    Rectangle size{};
    glfwGetFramebufferSize(window_.get(), &size.width, &size.height);
    return size;
}

void Window::present() {
    glfwSwapBuffers(window_.get());
    glFinish(); // waits for the GPU; otherwise the driver queues pictures, which adds latency
    stale_ = false;
}

void Window::toggle_full_screen() {
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
GLFWmonitor *Window::monitor_in_view() const {
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

} // namespace sink_window
