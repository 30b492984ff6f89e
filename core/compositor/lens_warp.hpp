// SPDX-License-Identifier: Apache-2.0
//
// For ray tracers without lens distortion: they render a pinhole image with a slightly larger field of view, which is
// warped to the real lens before compositing.
#pragma once

#include "compositor/compositor.hpp"

#include <arhost/camera.h>

#include <vector>

namespace arhost {

class LensWarp {
public:
    explicit LensWarp(const arhost_intrinsics &lens);

    // Intrinsics to render with: same image size, no distortion, field of view large enough for all that the lens
    // sees within 76° of its axis.
    const arhost_intrinsics &pinhole() const { return pinhole_; }

    // Warps the pinhole image to the lens, bilinearly with premultiplied alpha; alpha is 0 where the pinhole image
    // has no data. The result is valid until the next call.
    ImageView warp(const ImageView &image, const Region &region);

private:
    struct Point { // px in the pinhole image; outside of it if there is no data
        float x, y;
    };
    arhost_intrinsics pinhole_;
    std::vector<Point> sources_; // per pixel of the lens image
    std::vector<std::uint8_t> warped_;
};

} // namespace arhost
