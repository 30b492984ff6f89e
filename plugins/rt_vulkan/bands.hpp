// SPDX-License-Identifier: Apache-2.0
//
// Splits slow images into bands of rows, which are submitted one after another. There are two reasons for this: a
// driver's watchdog mistakes GPU work that takes seconds for a hang, and submitted work cannot be cancelled. The
// duration of a band determines the height of the next one.
#pragma once

#include <chrono>
#include <cstdint>

namespace rt_vulkan {

class Bands {
public:
    static constexpr std::uint32_t unit =
        8; // rows; the height of each band except an image's last is a multiple of this
    using Milliseconds = std::chrono::duration<double, std::milli>;

    // Aims at bands that take between half of `max_time` and `max_time`, or less if the whole image takes less.
    Bands(std::uint32_t image_rows, Milliseconds max_time) : image_rows_(image_rows), max_time_(max_time) {}
    // The number of rows of the next band. The caller reduces it for an image's last band.
    std::uint32_t rows() const { return rows_; }
    // Records that a band of `rows` took `time`, including other work in the same submission.
    void record(std::uint32_t rows, Milliseconds time);
    // Forgets the duration of earlier bands.
    void restart() { rows_ = unit; }

private:
    std::uint32_t image_rows_;
    Milliseconds max_time_;
    std::uint32_t rows_ = unit; // the first image starts with the minimum
};

} // namespace rt_vulkan
