// SPDX-License-Identifier: Apache-2.0
#include "bands.hpp"

#include <algorithm>

namespace rt_vulkan {

void Bands::record(std::uint32_t rows, Milliseconds time) {
    // The height at most doubles from band to band, because the next rows may be more expensive.
    if (time <= max_time_ / 2)
        rows_ = std::max(rows_, 2 * rows);
    else if (time > max_time_)
        rows_ = static_cast<std::uint32_t>(rows * (max_time_ / time));
    rows_ = std::clamp(rows_ / unit * unit, unit, (image_rows_ + unit - 1) / unit * unit);
}

} // namespace rt_vulkan
