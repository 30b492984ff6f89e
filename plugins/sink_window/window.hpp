// SPDX-License-Identifier: Apache-2.0
//
// A window with an OpenGL 2.1 context. The fixed-function pipeline suffices for a textured rectangle and text, and is
// available with every driver.
#pragma once

#define GLFW_INCLUDE_GLEXT
#include <GLFW/glfw3.h>

#include <arhost-cpp/plugin.hpp>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace sink_window {

struct Rectangle {
    int x, y, width, height;
};

// Returns the largest centred rectangle within `width`×`height` that has the aspect ratio of the image.
Rectangle fit(int image_width, int image_height, int width, int height);

// Lists the monitors. If no window can be opened, returns one display that states the reason.
std::vector<arhost::Device> list_displays();

class Glfw {
public:
    Glfw();
    ~Glfw();
    Glfw(const Glfw &) = delete;
    Glfw &operator=(const Glfw &) = delete;
};

struct DestroyWindow {
    void operator()(GLFWwindow *window) const { glfwDestroyWindow(window); }
};
using WindowPointer = std::unique_ptr<GLFWwindow, DestroyWindow>;

class Window {
public:
    // Called with each character that the user types, in lower case and according to the keyboard layout.
    using OnCharacter = std::function<void(char)>;

    // Opens a window for images of `width`×`height` px and makes its context current. Throws arhost::Failure.
    Window(int width, int height, double scale, bool vsync, const std::string &title, OnCharacter on_character);
    Window(const Window &) = delete;
    Window &operator=(const Window &) = delete;

    void process_events();
    void close();
    bool closed() const; // whether the user or close() has closed the window
    void toggle_full_screen();
    Rectangle size() const; // size of the framebuffer in px; x and y are 0
    void present();
    bool stale() const { return stale_; } // whether the content must be drawn again

private:
    static Window &self(GLFWwindow *window) { return *static_cast<Window *>(glfwGetWindowUserPointer(window)); }
    GLFWmonitor *monitor_in_view() const;

    Glfw glfw_;
    OnCharacter on_character_;
    WindowPointer window_;
    Rectangle windowed_{}; // position and size of the window before full screen
    bool stale_ = false;
    bool key_repeats_ = false; // whether the next character comes from a key that the user holds down
};

} // namespace sink_window
