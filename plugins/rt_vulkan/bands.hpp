// SPDX-License-Identifier: Apache-2.0
//
// The rows of an image per submission. A driver's watchdog takes seconds of GPU work for a hang, and submitted work
// cannot be cancelled: a slow image is split into bands of rows, whose height follows the last band's duration.
#pragma once

#include <chrono>
#include <cstdint>

namespace rt_vulkan {

class Bands {
public:
    static constexpr std::uint32_t unit = 8; // rows; bands have a multiple of this, except an image's last
    using Milliseconds = std::chrono::duration<double, std::milli>;

    // A band should take `max_time` at most, and at least half of it unless the whole image takes less.
    Bands(std::uint32_t image_rows, Milliseconds max_time) : image_rows_(image_rows), max_time_(max_time) {}
    // Of the next band; the image's last may have fewer.
    std::uint32_t rows() const { return rows_; }
    // Reports the time of a band of `rows`, including work submitted with it.
    void record(std::uint32_t rows, Milliseconds time);

private:
    std::uint32_t image_rows_;
    Milliseconds max_time_;
    std::uint32_t rows_ = unit; // the first image starts with the minimum
};

} // namespace rt_vulkan
