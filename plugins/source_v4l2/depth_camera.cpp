// SPDX-License-Identifier: Apache-2.0
#include "depth_camera.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>

namespace arhost {
namespace {

constexpr std::uint32_t buffer_count = 6; // up to two of them are held
constexpr std::int64_t default_interval_ns = 33'333'333;

std::int64_t now_ns() {
    return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

} // namespace

DepthCamera::DepthCamera(const Host &host, const std::string &path, const FrameSize &size, double fps, double unit_mm)
    : host_(host), device_(path, "depth_device"), clock_(host), unit_mm_(unit_mm), last_arrival_ns_(now_ns()) {
    const std::string camera = "depth_device: the camera '" + path + "' (" + device_.card() + ")";
    const CaptureFormat *depth = device_.find(V4L2_PIX_FMT_Z16);
    if (!depth)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      camera + " offers no depth (Z16), only " + device_.describe_formats());
    const PictureFormat format = device_.set_format(V4L2_PIX_FMT_Z16, size.width, size.height);
    const FrameSize offered{format.width, format.height};
    if (format.fourcc != V4L2_PIX_FMT_Z16 || offered != size)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      camera + " has no depth of the colour frames' size " + size.text() + " (it would deliver " +
                          offered.text() + "); the nearest sizes are " +
                          device_.describe_sizes_near(*depth, size.width, size.height) +
                          "; set 'width' and 'height' to a size that both cameras have");
    stride_ = format.strides.front();
    if (stride_ < 2 * size.width)
        throw Failure(ARHOST_STATUS_ERROR_IO, camera + " has a defective driver: rows of " + std::to_string(stride_) +
                                                  " bytes for " + std::to_string(size.width) + " px");
    const double rate = device_.set_fps(fps);
    interval_ns_ = rate > 0 ? std::llround(1e9 / rate) : default_interval_ns;
    stream_.emplace(device_, buffer_count);
    host_.info("depth: " + device_.card() + " at " + path + ": " + size.text() + ", " + std::to_string(rate) +
               " fps");
}

bool DepthCamera::read(std::int64_t colour_ns, const arhost_frame_buffer &buffer) {
    // Frame times jitter, so the nearest frame may be slightly more than half a frame time away.
    const std::int64_t max_difference_ns = interval_ns_ * 6 / 10;
    dequeue_up_to(colour_ns);
    wait_for_frame_near(colour_ns);
    const bool found = !held_.empty() && std::abs(held_.front().ns - colour_ns) <= max_difference_ns &&
                       copy(held_.front().capture, buffer);
    if (!found)
        for (std::uint32_t y = 0; y < buffer.format->height; ++y)
            std::fill_n(buffer.depth_mm + std::size_t{y} * buffer.format->depth_stride / 2, buffer.format->width, 0);
    return found;
}

// Waits until no later frame can be nearer to `colour_ns`. Frames arrive at most two frame times after their capture.
// Does not wait for a camera that has stopped.
void DepthCamera::wait_for_frame_near(std::int64_t colour_ns) {
    while (!host_.cancelled() && (held_.empty() || held_.back().ns < colour_ns - interval_ns_ / 2)) {
        const std::int64_t now = now_ns();
        if (silence_.exceeds_limit())
            throw Failure(ARHOST_STATUS_ERROR_DEVICE_LOST, "the depth camera '" + device_.path() + "' (" +
                                                               device_.card() +
                                                               ") has delivered no intact frame for 5 s");
        if (now > colour_ns + 3 * interval_ns_ || now - last_arrival_ns_ > 4 * interval_ns_)
            return;
        stream_->wait(static_cast<int>(interval_ns_ / 1'000'000) + 1);
        dequeue_up_to(colour_ns);
    }
}

// Takes frames from the driver up to the first frame that was captured after `colour_ns`, because later frames may
// belong to the next colour frames. Keeps the nearest frame and all frames after it.
void DepthCamera::dequeue_up_to(std::int64_t colour_ns) {
    while (held_.empty() || held_.back().ns < colour_ns) {
        std::optional<Capture> captured = stream_->dequeue();
        if (!captured)
            break;
        if (captured->flags & V4L2_BUF_FLAG_ERROR) {
            stream_->queue(captured->index);
            continue;
        }
        last_arrival_ns_ = now_ns();
        silence_ = Silence();
        const std::int64_t captured_ns = clock_.monotonic_ns(*captured);
        held_.push_back({std::move(*captured), captured_ns});
        release_farther_than_next(colour_ns);
    }
    release_farther_than_next(colour_ns);
}

void DepthCamera::release_farther_than_next(std::int64_t colour_ns) {
    while (held_.size() > 1 && std::abs(held_[1].ns - colour_ns) <= std::abs(held_[0].ns - colour_ns)) {
        stream_->queue(held_.front().capture.index);
        held_.pop_front();
    }
}

bool DepthCamera::copy(const Capture &capture, const arhost_frame_buffer &buffer) const {
    const std::span<const std::uint8_t> bytes = capture.planes.front();
    const std::size_t width = buffer.format->width, height = buffer.format->height;
    if (bytes.size() < stride_ * (height - 1) + 2 * width)
        return false;
    for (std::size_t y = 0; y < height; ++y) {
        std::uint16_t *const row = buffer.depth_mm + y * buffer.format->depth_stride / 2;
        std::memcpy(row, bytes.data() + y * stride_, 2 * width); // Z16 is little-endian
        if (unit_mm_ != 1)
            std::transform(row, row + width, row, [&](std::uint16_t depth) {
                return static_cast<std::uint16_t>(std::min(std::lround(depth * unit_mm_), 65535L));
            });
    }
    return true;
}

} // namespace arhost
