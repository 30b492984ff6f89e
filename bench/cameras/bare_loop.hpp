// SPDX-License-Identifier: Apache-2.0
//
// Shared by the bare capture loops.
#pragma once

#include "pixels/grey.hpp"

#include <sys/resource.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

namespace arhost::bench {

constexpr int warm_up_frames = 30;

inline double cpu_ms() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    const auto ms = [](const timeval &time) { return 1e3 * double(time.tv_sec) + 1e-3 * double(time.tv_usec); };
    return ms(usage.ru_utime) + ms(usage.ru_stime);
}

// Prints the CPU time per frame in ms, in the given number of frames after the first ones.
class Measurement {
public:
    explicit Measurement(int frames) : frames_(frames) {}
    // Returns false after the last frame.
    bool count_frame() {
        if (++count_ == warm_up_frames)
            begin_ms_ = cpu_ms();
        if (count_ < warm_up_frames + frames_)
            return true;
        std::printf("%.6f\n", (cpu_ms() - begin_ms_) / frames_);
        return false;
    }

private:
    int frames_, count_ = 0;
    double begin_ms_ = 0;
};

// Frames with the layout of arhost's slots.
class Slots {
public:
    Slots(arhost_pixel_format pixel_format, std::uint32_t width, std::uint32_t height) {
        format_.struct_size = sizeof format_;
        format_.pixel_format = pixel_format;
        format_.width = width;
        format_.height = height;
        format_.yuv_matrix = ARHOST_YUV_MATRIX_BT601;
        format_.yuv_range = ARHOST_YUV_RANGE_LIMITED;
        if (!arhost_frame_layout(&format_))
            std::exit(2);
        memory_.assign(count, std::vector<std::uint8_t>(format_.byte_size));
    }
    const arhost_frame_format &format() const { return format_; }
    std::uint8_t *plane(std::size_t plane) { return memory_[current_].data() + format_.offset[plane]; }
    void copy_rows(std::size_t plane, const std::uint8_t *from, std::size_t row_bytes, std::size_t rows) {
        std::uint8_t *to = this->plane(plane);
        const std::size_t stride = format_.stride[plane];
        if (stride == row_bytes) {
            std::memcpy(to, from, rows * row_bytes);
            return;
        }
        for (std::size_t y = 0; y < rows; ++y)
            std::memcpy(to + y * stride, from + y * row_bytes, row_bytes);
    }
    // Makes the grey plane and continues with the next slot.
    void finish() {
        std::array<std::uint8_t *, ARHOST_MAX_PLANES> planes{};
        for (std::size_t p = 0; p < format_.plane_count; ++p)
            planes[p] = plane(p);
        if (format_.grey_offset != format_.offset[0])
            fill_grey(format_, planes.data(), memory_[current_].data() + format_.grey_offset);
        current_ = (current_ + 1) % count;
    }

private:
    static constexpr std::size_t count = 8; // as many as the host gives to a source
    arhost_frame_format format_{};
    std::vector<std::vector<std::uint8_t>> memory_;
    std::size_t current_ = 0;
};

} // namespace arhost::bench
