// SPDX-License-Identifier: Apache-2.0
//
// A V4L2 output device, through the single- or the multi-planar API. Functions that fail throw Failure with a message
// for the user.
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <linux/videodev2.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace arhost {

// The format that the device expects. `colour_space` and the other constants are V4L2's.
struct OutputFormat {
    std::uint32_t fourcc = 0, width = 0, height = 0;
    std::uint32_t stride = 0;     // bytes per row of the first plane
    std::uint32_t image_size = 0; // bytes
    std::uint32_t colour_space = 0, ycbcr_encoding = 0;
};

enum class Transfer { write, mmap };

class OutputDevice {
public:
    // Opens the device and checks that it accepts video.
    explicit OutputDevice(const std::string &path);
    ~OutputDevice();
    OutputDevice(const OutputDevice &) = delete;
    OutputDevice &operator=(const OutputDevice &) = delete;

    std::string name() const { return "'" + path_ + "'" + (card_.empty() ? "" : " (" + card_ + ")"); }
    std::vector<std::uint32_t> formats() const; // pixel formats that the device accepts
    bool supports(Transfer transfer) const;

    // Requests a format. Returns the format that the driver has chosen.
    OutputFormat set_format(const OutputFormat &wanted);
    double set_fps(double fps); // returns the resulting rate; 0: unknown

    // Allocates memory for images. Afterwards the format cannot change, and with Transfer::mmap other programs cannot
    // use the device.
    void reserve(Transfer transfer);
    // Waits until the device accepts another image. Returns the memory for the image, which has
    // OutputFormat::image_size bytes. Returns an empty span if the host has cancelled the call.
    std::span<std::uint8_t> begin_image(const Host &host);
    void end_image(const Host &host); // hands over the image; the first one starts the stream

private:
    struct Unmap {
        std::size_t size = 0;
        void operator()(std::uint8_t *address) const;
    };
    using Mapping = std::unique_ptr<std::uint8_t, Unmap>;
    // A v4l2_buffer and, for the multi-planar API, its plane.
    struct Buffer {
        v4l2_buffer info{};
        v4l2_plane plane{};
    };

    int control(unsigned long request, void *argument) const; // returns 0 or an errno value
    [[noreturn]] void fail(const std::string &what, int error) const;
    bool is_multiplanar() const { return type_ == V4L2_BUF_TYPE_VIDEO_OUTPUT_MPLANE; }
    void prepare(Buffer &buffer, std::uint32_t index) const;
    void map_buffers();
    bool wait_until_writable(const Host &host) const; // false: the host has cancelled the call

    std::string path_, card_;
    int fd_;
    std::uint32_t capabilities_ = 0;
    v4l2_buf_type type_ = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    std::uint32_t image_size_ = 0;
    Transfer transfer_ = Transfer::mmap;
    std::vector<std::uint8_t> image_; // only for Transfer::write
    std::vector<Mapping> buffers_;    // only for Transfer::mmap
    std::uint32_t queued_ = 0;        // number of buffers that were queued at least once
    std::uint32_t current_ = 0;       // index of the buffer that begin_image has returned
};

} // namespace arhost
