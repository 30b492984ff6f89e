// SPDX-License-Identifier: Apache-2.0
// A frame of the video, for ray tracers. It has no grey plane, which only trackers read.
#pragma once

#include <arhost/frame.h>

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

namespace arhost::conformance {

class Video {
public:
    using Rgb = std::array<std::uint8_t, 3>;
    // Width and height must be even. NV12 has BT.709's matrix and limited range; YUYV and I420 have BT.601's matrix
    // and full range.
    Video(arhost_pixel_format pixel_format, std::uint32_t width, std::uint32_t height,
          std::function<Rgb(std::uint32_t x, std::uint32_t y)> colour);
    Video(const Video &) = delete;
    Video &operator=(const Video &) = delete;

    const arhost_frame_format &format() const { return format_; }
    const arhost_frame &frame() const { return frame_; }
    Rgb colour(std::uint32_t x, std::uint32_t y) const; // sRGB codes; of GREY8, three equal ones

private:
    std::function<Rgb(std::uint32_t, std::uint32_t)> colour_;
    arhost_frame_format format_{};
    std::vector<std::uint8_t> bytes_;
    arhost_frame frame_{};
};

} // namespace arhost::conformance
