// SPDX-License-Identifier: Apache-2.0
//
// Starts a virtual X server for one test, and provides an X client that inspects the sink's window.
#pragma once

#include <X11/Xlib.h>
#include <X11/Xutil.h>
#include <X11/keysym.h>

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace arhost::test {

constexpr const char *xvfb_path = "/usr/bin/Xvfb";

class XServer {
public:
    XServer(int width, int height, bool has_opengl = true) {
        int ends[2];
        if (pipe(ends) != 0)
            throw std::runtime_error("pipe");
        const std::string screen = std::to_string(width) + "x" + std::to_string(height) + "x24";
        const std::string number_fd = std::to_string(ends[1]);
        pid_ = fork();
        if (pid_ == 0) {
            prctl(PR_SET_PDEATHSIG, SIGKILL);
            const int nowhere = open("/dev/null", O_WRONLY);
            dup2(nowhere, STDERR_FILENO);
            // With -displayfd, Xvfb chooses a free display number and writes it to the pipe when it is ready.
            execl(xvfb_path, "Xvfb", "-displayfd", number_fd.c_str(), "-screen", "0", screen.c_str(), "-noreset",
                  "-nolisten", "tcp", has_opengl ? "+extension" : "-extension", "GLX", nullptr);
            _exit(127);
        }
        ::close(ends[1]);
        std::string number;
        for (char c; read(ends[0], &c, 1) == 1 && c != '\n';)
            number += c;
        ::close(ends[0]);
        if (number.empty())
            throw std::runtime_error("Xvfb did not start");
        name_ = ":" + number;
    }
    ~XServer() {
        kill(pid_, SIGTERM);
        waitpid(pid_, nullptr, 0);
    }
    XServer(const XServer &) = delete;
    XServer &operator=(const XServer &) = delete;
    const std::string &name() const { return name_; }

private:
    pid_t pid_;
    std::string name_;
};

struct Screenshot {
    int width, height;
    std::vector<std::uint8_t> bgr;
    const std::uint8_t *pixel(int x, int y) const { return &bgr[3 * (static_cast<std::size_t>(y) * width + x)]; }
};

// Connects to the X server as a second client and inspects the only window on the screen.
class XObserver {
public:
    explicit XObserver(const std::string &display) : display_(XOpenDisplay(display.c_str())) {
        if (!display_)
            throw std::runtime_error("cannot connect to the X display " + display);
    }
    ~XObserver() { XCloseDisplay(display_); }
    XObserver(const XObserver &) = delete;
    XObserver &operator=(const XObserver &) = delete;

    Screenshot screen() const {
        const int number = DefaultScreen(display_);
        const int width = DisplayWidth(display_, number), height = DisplayHeight(display_, number);
        return take(RootWindow(display_, number), width, height);
    }
    Screenshot window() const {
        const XWindowAttributes a = attributes();
        return take(find(), a.width, a.height);
    }
    XWindowAttributes attributes() const {
        XWindowAttributes a{};
        XGetWindowAttributes(display_, find(), &a);
        return a;
    }
    std::string title() const {
        char *name = nullptr;
        XFetchName(display_, find(), &name);
        const std::string title = name ? name : "";
        XFree(name);
        return title;
    }
    void resize(int width, int height) const {
        XResizeWindow(display_, find(), static_cast<unsigned>(width), static_cast<unsigned>(height));
        XSync(display_, False);
    }
    // `times`: more than 1 for a key that the user holds, which repeats it.
    void press(KeySym key, int times = 1) {
        for (int i = 0; i <= times; ++i) {
            const int type = i < times ? KeyPress : KeyRelease;
            XEvent event{};
            event.xkey.type = type;
            event.xkey.display = display_;
            event.xkey.window = find();
            event.xkey.root = DefaultRootWindow(display_);
            event.xkey.time = time_ += 10;
            event.xkey.same_screen = True;
            event.xkey.keycode = XKeysymToKeycode(display_, key);
            XSendEvent(display_, find(), True, type == KeyPress ? KeyPressMask : KeyReleaseMask, &event);
        }
        XSync(display_, False);
    }
    void close_window() const { // asks the window to close, as a window manager does
        XEvent event{};
        event.xclient.type = ClientMessage;
        event.xclient.window = find();
        event.xclient.message_type = XInternAtom(display_, "WM_PROTOCOLS", False);
        event.xclient.format = 32;
        event.xclient.data.l[0] = static_cast<long>(XInternAtom(display_, "WM_DELETE_WINDOW", False));
        XSendEvent(display_, find(), False, NoEventMask, &event);
        XSync(display_, False);
    }

private:
    Window find() const {
        Window root = 0, parent = 0, *children = nullptr;
        unsigned count = 0;
        XQueryTree(display_, DefaultRootWindow(display_), &root, &parent, &children, &count);
        std::optional<Window> found;
        for (unsigned i = 0; i < count; ++i) {
            XWindowAttributes a{};
            XGetWindowAttributes(display_, children[i], &a);
            if (a.map_state == IsViewable)
                found = children[i];
        }
        XFree(children);
        if (!found)
            throw std::runtime_error("no window is on the screen");
        return *found;
    }
    Screenshot take(Drawable drawable, int width, int height) const {
        XImage *image = XGetImage(display_, drawable, 0, 0, static_cast<unsigned>(width),
                                  static_cast<unsigned>(height), AllPlanes, ZPixmap);
        if (!image || image->bits_per_pixel != 32)
            throw std::runtime_error("cannot take a screenshot");
        Screenshot shot{width, height, {}};
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                const char *p = image->data + y * image->bytes_per_line + 4 * x;
                shot.bgr.insert(shot.bgr.end(), p, p + 3);
            }
        XDestroyImage(image);
        return shot;
    }

    Display *display_;
    Time time_ = 1000;
};

} // namespace arhost::test
