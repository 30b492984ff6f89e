// SPDX-License-Identifier: Apache-2.0
#include "bands.hpp"

#include <algorithm>

namespace rt_vulkan {

void Bands::took(std::uint32_t rows, Milliseconds time) {
    // Never more than doubled: the next rows may show more than these.
    if (time <= most_ / 2)
        rows_ = std::max(rows_, 2 * rows);
    else if (time > most_)
        rows_ = static_cast<std::uint32_t>(rows * (most_ / time));
    rows_ = std::clamp(rows_ / unit * unit, unit, (image_rows_ + unit - 1) / unit * unit);
}

} // namespace rt_vulkan
