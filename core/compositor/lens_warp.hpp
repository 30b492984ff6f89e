// SPDX-License-Identifier: Apache-2.0
//
// For ray tracers that know no lens: they trace a pinhole camera that sees a little more, and their image is
// bent as the real lens bends before it is laid over the video.
#pragma once

#include "compositor/compositor.hpp"

#include <arhost/camera.h>

#include <vector>

namespace arhost {

class LensWarp {
public:
    explicit LensWarp(const arhost_intrinsics &lens);

    // What to trace: the lens' image size, without distortion, wide enough for all that the lens sees within
    // 76° of its axis.
    const arhost_intrinsics &pinhole() const { return pinhole_; }

    // The pinhole's image as the lens would show it; alpha 0 where the lens sees nothing of it. Between pixels it
    // is mixed premultiplied. Valid until the next call.
    ImageView bend(const ImageView &image, const Region &region);

private:
    struct Place { // px in the pinhole's image; outside of it where there is nothing
        float x, y;
    };
    arhost_intrinsics pinhole_;
    std::vector<Place> places_; // a pixel of the lens' image
    std::vector<std::uint8_t> bent_;
};

} // namespace arhost
