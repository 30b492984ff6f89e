// SPDX-License-Identifier: Apache-2.0
//
// A V4L2 capture device: its formats and its stream of memory-mapped buffers. Errors are thrown as Failure with a
// message for the user.
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
    double max_fps = 0; // 0: unknown
};

// The sizes of one pixel format. A range is listed as its minimum and maximum.
struct CaptureFormat {
    std::uint32_t fourcc = 0;
    std::vector<CaptureSize> sizes;
    bool any_size = false; // between minimum and maximum
};

std::string fourcc_text(std::uint32_t fourcc); // "YUYV"

class CaptureDevice {
public:
    // Opens the device and checks that it captures video.
    explicit CaptureDevice(const std::string &path);

    const std::string &path() const { return path_; }
    const std::string &card() const { return card_; } // name of the camera
    const std::vector<CaptureFormat> &formats() const { return formats_; }
    const CaptureFormat *find(std::uint32_t fourcc) const;
    double max_fps(std::uint32_t fourcc, std::uint32_t width, std::uint32_t height) const; // 0: unknown
    std::string describe_formats() const; // "YUYV (640×480 30 fps, …), MJPG (…)"
    std::string describe_sizes_near(const CaptureFormat &format, std::uint32_t width, std::uint32_t height) const;

    v4l2_format current_format() const;
    v4l2_format set_format(std::uint32_t fourcc, std::uint32_t width, std::uint32_t height);
    double set_fps(double fps); // 0: unchanged. Returns the resulting rate; 0: unknown

    // ioctl, repeated on EINTR. Returns 0 or an errno.
    int control(unsigned long request, void *argument) const;
    // Throws Failure for errno `error` of operation `what`.
    [[noreturn]] void fail(const std::string &what, int error) const;
    int fd() const { return fd_.get(); }

private:
    std::string path_, card_;
    FileDescriptor fd_;
    std::vector<CaptureFormat> formats_;
};

class CaptureStream {
public:
    CaptureStream(const CaptureDevice &device, std::uint32_t buffer_count); // starts streaming
    ~CaptureStream();
    CaptureStream(const CaptureStream &) = delete;
    CaptureStream &operator=(const CaptureStream &) = delete;

    // The oldest filled buffer; nullopt if there is none. The caller queues it again.
    std::optional<v4l2_buffer> dequeue() const;
    void queue(std::uint32_t index) const;
    std::span<const std::uint8_t> bytes(const v4l2_buffer &buffer) const; // as reported by the driver
    // Waits for a frame; false on timeout.
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
