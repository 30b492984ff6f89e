// SPDX-License-Identifier: Apache-2.0
//
// Determines the frame size that a camera must have, from the options `width` and `height` and from the calibration.
#pragma once

#include <arhost/camera.h>

#include <cstdint>
#include <string>

namespace arhost {

struct FrameSize {
    std::uint32_t width = 0, height = 0; // px
    std::string text() const { return std::to_string(width) + "×" + std::to_string(height); }
    bool operator==(const FrameSize &) const = default;
};

struct DemandedSize {
    FrameSize size;     // 0×0: any
    std::string advice; // what the user can change if the camera does not have this size
};

// `configured`: the size in the options; 0×0 if it is not set. `calibration`: may be NULL. Throws Failure if both
// sizes are known and differ.
DemandedSize demanded_size(const FrameSize &configured, const arhost_intrinsics *calibration);

} // namespace arhost
