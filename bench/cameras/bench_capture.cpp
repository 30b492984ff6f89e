// SPDX-License-Identifier: Apache-2.0
//
// A bare capture loop with the same copies as a worker with source_v4l2: each frame is copied once, and a grey plane
// is made of YUYV. Prints its CPU time per frame in ms:
//   bench-capture DEVICE yuyv|grey WIDTH HEIGHT FPS FRAMES
#include "bare_loop.hpp"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>

#include <string>

namespace {

template <class T> void request(int fd, unsigned long code, T &argument, const char *what) {
    if (ioctl(fd, code, &argument) != 0) {
        std::perror(what);
        std::exit(1);
    }
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
    const int fd = open(arguments[1], O_RDWR | O_NONBLOCK | O_CLOEXEC);
    v4l2_format set{};
    set.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    set.fmt.pix.width = width;
    set.fmt.pix.height = height;
    set.fmt.pix.pixelformat = is_yuyv ? V4L2_PIX_FMT_YUYV : V4L2_PIX_FMT_GREY;
    request(fd, VIDIOC_S_FMT, set, "setting the format");
    v4l2_streamparm rate{};
    rate.type = set.type;
    rate.parm.capture.timeperframe = {1000, static_cast<std::uint32_t>(1000 * std::atof(arguments[5]))};
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

    arhost::bench::Slots slots(is_yuyv ? ARHOST_PIXEL_FORMAT_YUYV : ARHOST_PIXEL_FORMAT_GREY8, width, height);
    arhost::bench::Measurement measurement(std::atoi(arguments[6]));
    do {
        pollfd ready{fd, POLLIN, 0};
        poll(&ready, 1, -1);
        v4l2_buffer buffer{};
        buffer.type = set.type;
        buffer.memory = V4L2_MEMORY_MMAP;
        request(fd, VIDIOC_DQBUF, buffer, "capturing");
        slots.copy_rows(0, static_cast<const std::uint8_t *>(mapped[buffer.index]),
                        (is_yuyv ? 2 : 1) * std::size_t{width}, height);
        request(fd, VIDIOC_QBUF, buffer, "queueing a buffer");
        slots.finish();
    } while (measurement.count_frame());
    return 0;
}
