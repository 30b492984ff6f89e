// SPDX-License-Identifier: Apache-2.0
//
// A V4L2 capture device: its formats and its stream of memory-mapped buffers, through the single- or the multi-planar
// API. Functions that fail throw Failure with a message for the user.
#pragma once

#include "camera_common/file_descriptor.hpp"

#include <arhost-cpp/plugin.hpp>

#include <linux/videodev2.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace arhost {

struct CaptureSize {
    std::uint32_t width = 0, height = 0;
    std::vector<double> rates; // frames per second, highest first; empty: unknown
    bool any_rate = false;     // whether `rates` contains the two ends of a range
    double max_fps() const { return rates.empty() ? 0 : rates.front(); }
};

// The sizes that a camera offers in one pixel format. For a range of sizes, `sizes` has its minimum and maximum.
struct CaptureFormat {
    std::uint32_t fourcc = 0;
    std::vector<CaptureSize> sizes;
    bool any_size = false; // any size in the range is available
};

// The current format of a camera.
struct PictureFormat {
    std::uint32_t fourcc = 0, width = 0, height = 0;
    std::uint32_t colour_space = 0, ycbcr_encoding = 0, quantization = 0, transfer = 0; // V4L2's constants
    std::vector<std::uint32_t> strides; // bytes per row in each plane of memory; the single-planar API has one
};

// A filled buffer.
struct Capture {
    std::uint32_t index = 0, flags = 0, sequence = 0;
    timeval time{};
    std::vector<std::span<const std::uint8_t>> planes; // planes of memory, with the size that the driver reported
};

// Returns the nodes /dev/video*, in the order of their numbers, with the kernel's names for them ("" if unknown).
std::vector<std::string> video_nodes();
std::string card_of(const std::string &node);

// The reasons why CaptureDevice cannot be constructed.
struct CannotOpen : Failure {
    CannotOpen(arhost_status status, const std::string &message, int error)
        : Failure(status, message), error(error) {}
    int error; // errno of open()
};
struct NotACamera : Failure {
    using Failure::Failure;
};

class CaptureDevice {
public:
    // Opens the device and checks that it captures video. Throws CannotOpen or NotACamera. `option`: the option that
    // names the device, for messages.
    explicit CaptureDevice(const std::string &path, const std::string &option = "device");

    const std::string &path() const { return path_; }
    const std::string &card() const { return card_; } // name of the camera
    const std::vector<CaptureFormat> &formats() const { return formats_; }
    const CaptureFormat *find(std::uint32_t fourcc) const;
    double max_fps(std::uint32_t fourcc, std::uint32_t width, std::uint32_t height) const; // 0: unknown
    bool is_busy() const;                 // whether another program captures
    std::string describe_formats() const; // for example "YUYV (640×480 30 fps, …), MJPG (…)"
    std::string describe_sizes_near(const CaptureFormat &format, std::uint32_t width, std::uint32_t height) const;

    PictureFormat current_format() const;
    PictureFormat set_format(std::uint32_t fourcc, std::uint32_t width, std::uint32_t height);
    double set_fps(double fps); // 0 keeps the current rate. Returns the resulting rate; 0: unknown

    // Calls ioctl and repeats it on EINTR. Returns 0 or an errno value.
    int control(unsigned long request, void *argument) const;
    // Throws or returns a Failure for the errno value `error`. `what`: the operation that failed ("querying its
    // format").
    Failure failure_of(const std::string &what, int error) const;
    [[noreturn]] void fail(const std::string &what, int error) const;
    int fd() const { return fd_.get(); }
    v4l2_buf_type buffer_type() const { return buffer_type_; }
    bool is_multiplanar() const { return buffer_type_ == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE; }

private:
    v4l2_format query_format() const;

    std::string path_, option_, card_;
    v4l2_buf_type buffer_type_ = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    FileDescriptor fd_;
    std::vector<CaptureFormat> formats_;
};

class CaptureStream {
public:
    CaptureStream(const CaptureDevice &device, std::uint32_t buffer_count); // starts streaming
    ~CaptureStream();
    CaptureStream(const CaptureStream &) = delete;
    CaptureStream &operator=(const CaptureStream &) = delete;

    // Returns the oldest filled buffer, or std::nullopt if there is none. The caller must queue the buffer again.
    std::optional<Capture> dequeue() const;
    void queue(std::uint32_t index) const;
    // Waits for a frame. Returns false on timeout.
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
    std::vector<std::vector<Mapping>> mappings_; // one entry per buffer and plane
};

} // namespace arhost
