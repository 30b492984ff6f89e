// SPDX-License-Identifier: Apache-2.0
//
// A bare capture loop with the same copies as a worker with source_v4l2: each frame is copied once, and a grey plane
// is made of YUYV. Prints its CPU time per frame in ms:
//   bench-capture DEVICE FORMAT WIDTH HEIGHT FPS FRAMES
#include "pixels/grey.hpp"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

namespace {

template <class T> void request(int fd, unsigned long code, T &argument, const char *what) {
    if (ioctl(fd, code, &argument) != 0) {
        std::perror(what);
        std::exit(1);
    }
}

double cpu_ms() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    const auto ms = [](const timeval &time) { return 1e3 * double(time.tv_sec) + 1e-3 * double(time.tv_usec); };
    return ms(usage.ru_utime) + ms(usage.ru_stime);
}

} // namespace

int main(int count, char **arguments) {
    if (count != 7) {
        std::fprintf(stderr, "usage: bench-capture DEVICE yuyv|grey WIDTH HEIGHT FPS FRAMES\n");
        return 2;
    }
    const bool is_yuyv = arguments[2] == std::string("yuyv");
    const auto width = static_cast<std::uint32_t>(std::atoi(arguments[3]));
    const auto height = static_cast<std::uint32_t>(std::atoi(arguments[4]));
    const int frames = std::atoi(arguments[6]);
    const int fd = open(arguments[1], O_RDWR | O_NONBLOCK | O_CLOEXEC);
    v4l2_format set{};
    set.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    set.fmt.pix.width = width;
    set.fmt.pix.height = height;
    set.fmt.pix.pixelformat = is_yuyv ? V4L2_PIX_FMT_YUYV : V4L2_PIX_FMT_GREY;
    request(fd, VIDIOC_S_FMT, set, "setting the format");
    v4l2_streamparm rate{};
    rate.type = set.type;
    rate.parm.capture.timeperframe = {1, static_cast<std::uint32_t>(std::atoi(arguments[5]))};
    request(fd, VIDIOC_S_PARM, rate, "setting the rate");
    v4l2_requestbuffers buffers{};
    buffers.count = 4;
    buffers.type = set.type;
    buffers.memory = V4L2_MEMORY_MMAP;
    request(fd, VIDIOC_REQBUFS, buffers, "reserving buffers");
    std::vector<void *> mapped;
    for (std::uint32_t i = 0; i < buffers.count; ++i) {
        v4l2_buffer buffer{};
        buffer.type = set.type;
        buffer.memory = V4L2_MEMORY_MMAP;
        buffer.index = i;
        request(fd, VIDIOC_QUERYBUF, buffer, "querying a buffer");
        mapped.push_back(mmap(nullptr, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED, fd, buffer.m.offset));
        request(fd, VIDIOC_QBUF, buffer, "queueing a buffer");
    }
    int type = static_cast<int>(set.type);
    request(fd, VIDIOC_STREAMON, type, "starting the stream");

    arhost_frame_format format{};
    format.struct_size = sizeof format;
    format.pixel_format = is_yuyv ? ARHOST_PIXEL_FORMAT_YUYV : ARHOST_PIXEL_FORMAT_GREY8;
    format.width = width;
    format.height = height;
    format.yuv_matrix = ARHOST_YUV_MATRIX_BT601;
    format.yuv_range = ARHOST_YUV_RANGE_LIMITED;
    if (!arhost_frame_layout(&format))
        return 2;
    constexpr std::size_t slots = 8; // as many as the host gives to a source
    std::vector<std::vector<std::uint8_t>> memory(slots, std::vector<std::uint8_t>(format.byte_size));
    const std::size_t row_bytes = (is_yuyv ? 2 : 1) * std::size_t{width};
    double begin_ms = 0;
    for (int n = -30; n < frames; ++n) { // 30 frames to warm up
        if (n == 0)
            begin_ms = cpu_ms();
        pollfd ready{fd, POLLIN, 0};
        poll(&ready, 1, -1);
        v4l2_buffer buffer{};
        buffer.type = set.type;
        buffer.memory = V4L2_MEMORY_MMAP;
        request(fd, VIDIOC_DQBUF, buffer, "capturing");
        std::vector<std::uint8_t> &slot = memory[static_cast<std::size_t>(n + 30) % slots];
        const auto *from = static_cast<const std::uint8_t *>(mapped[buffer.index]);
        std::array<std::uint8_t *, ARHOST_MAX_PLANES> planes{slot.data() + format.offset[0]};
        for (std::uint32_t y = 0; y < height; ++y)
            std::memcpy(planes[0] + y * std::size_t{format.stride[0]}, from + y * row_bytes, row_bytes);
        request(fd, VIDIOC_QBUF, buffer, "queueing a buffer");
        if (is_yuyv)
            arhost::fill_grey(format, planes.data(), slot.data() + format.grey_offset);
    }
    std::printf("%.6f\n", (cpu_ms() - begin_ms) / frames);
    return 0;
}
