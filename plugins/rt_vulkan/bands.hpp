// SPDX-License-Identifier: Apache-2.0
//
// How many of an image's rows the device is asked for at once. A driver's watchdog takes work of some seconds for a
// hang, and nothing calls work back: what takes long is asked for in parts, by the time that the last part took.
#pragma once

#include <chrono>
#include <cstdint>

namespace rt_vulkan {

class Bands {
public:
    static constexpr std::uint32_t unit = 8; // px; each band but an image's last has a multiple of this
    using Milliseconds = std::chrono::duration<double, std::milli>;

    // No band is to take longer than `most`, nor less than half of that where an image does.
    Bands(std::uint32_t image_rows, Milliseconds most) : image_rows_(image_rows), most_(most) {}
    // Of the next band; where fewer are left, those.
    std::uint32_t rows() const { return rows_; }
    // So long did so many rows take, with what came before and after them.
    void took(std::uint32_t rows, Milliseconds time);

private:
    std::uint32_t image_rows_;
    Milliseconds most_;
    std::uint32_t rows_ = unit; // of what has not been seen yet, the least
};

} // namespace rt_vulkan
