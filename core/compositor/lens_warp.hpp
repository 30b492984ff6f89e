// SPDX-License-Identifier: Apache-2.0
//
// Supports ray tracers that cannot render lens distortion: such a ray tracer renders a pinhole image with a slightly
// larger field of view, and the host warps this image to the real lens before compositing.
#pragma once

#include "compositor/compositor.hpp"

#include <arhost/camera.h>

#include <vector>

namespace arhost {

class LensWarp {
public:
    explicit LensWarp(const arhost_intrinsics &lens);

    // Returns the intrinsics of the pinhole image: same image size, no distortion, and a field of view that contains
    // everything that the lens sees within 76° of its optical axis.
    const arhost_intrinsics &pinhole() const { return pinhole_; }

    // Warps the pinhole image to the lens, bilinearly with premultiplied alpha; alpha is 0 where the pinhole image
    // has no data. The result is valid until the next call.
    ImageView warp(const ImageView &image, const Region &region);

private:
    struct Point { // px in the pinhole image; a position outside the image means that there is no data
        float x, y;
    };
    arhost_intrinsics pinhole_;
    std::vector<Point> sources_; // for each pixel of the lens image, the corresponding point of the pinhole image
    std::vector<std::uint8_t> warped_;
};

} // namespace arhost
