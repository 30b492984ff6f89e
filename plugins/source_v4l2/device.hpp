// SPDX-License-Identifier: Apache-2.0
//
// A V4L2 capture device: what it offers, and its stream of memory-mapped buffers. Everything it holds
// goes with the objects. Errors are Failures in words for the user.
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <linux/videodev2.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace arhost {

class FileDescriptor {
public:
    explicit FileDescriptor(int fd = -1) : fd_(fd) {}
    ~FileDescriptor();
    FileDescriptor(FileDescriptor &&other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
    FileDescriptor &operator=(FileDescriptor &&other) noexcept {
        std::swap(fd_, other.fd_);
        return *this;
    }
    int get() const { return fd_; }

private:
    int fd_;
};

struct CaptureSize {
    std::uint32_t width = 0, height = 0;
    double max_fps = 0; // 0: the driver does not tell
};

// What a driver offers in one pixel format. A range of sizes is listed by its ends.
struct CaptureFormat {
    std::uint32_t fourcc = 0;
    std::vector<CaptureSize> sizes;
    bool any_size = false; // between the ends
};

std::string fourcc_text(std::uint32_t fourcc); // "YUYV"

class CaptureDevice {
public:
    // Opens it and checks that it is a camera.
    explicit CaptureDevice(const std::string &path);

    const std::string &path() const { return path_; }
    const std::string &card() const { return card_; } // the camera's name
    const std::vector<CaptureFormat> &formats() const { return formats_; }
    const CaptureFormat *find(std::uint32_t fourcc) const;
    double max_fps(std::uint32_t fourcc, std::uint32_t width, std::uint32_t height) const; // 0: not told
    std::string describe_formats() const; // "YUYV (640×480 30 fps, …), MJPG (…)"
    std::string describe_sizes_near(const CaptureFormat &format, std::uint32_t width, std::uint32_t height) const;

    v4l2_format current_format() const;
    v4l2_format set_format(std::uint32_t fourcc, std::uint32_t width, std::uint32_t height);
    double set_fps(double fps); // 0: leave it. What the driver then does; 0: it does not tell

    // ioctl, again where a signal broke it off. Zero or an errno.
    int control(unsigned long request, void *argument) const;
    // Throws for an errno of `what`.
    [[noreturn]] void fail(const std::string &what, int error) const;
    int fd() const { return fd_.get(); }

private:
    std::string path_, card_;
    FileDescriptor fd_;
    std::vector<CaptureFormat> formats_;
};

class CaptureStream {
public:
    CaptureStream(const CaptureDevice &device, std::uint32_t buffer_count); // and starts it
    ~CaptureStream();
    CaptureStream(const CaptureStream &) = delete;
    CaptureStream &operator=(const CaptureStream &) = delete;

    // The oldest filled buffer; none where no frame is waiting. It is queued again by whoever took it.
    std::optional<v4l2_buffer> dequeue() const;
    void queue(std::uint32_t index) const;
    std::span<const std::uint8_t> bytes(const v4l2_buffer &buffer) const; // what the driver says it wrote
    // Waits for a frame, at most so long. False: not yet.
    bool wait(int timeout_ms) const;

private:
    struct Mapping {
        Mapping(void *address, std::size_t size) : address(address), size(size) {}
        ~Mapping();
        Mapping(Mapping &&other) noexcept : address(std::exchange(other.address, nullptr)), size(other.size) {}
        void *address;
        std::size_t size;
    };
    [[noreturn]] void fail_stopped() const;

    const CaptureDevice &device_;
    std::vector<Mapping> mappings_;
};

} // namespace arhost
