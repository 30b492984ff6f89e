// SPDX-License-Identifier: Apache-2.0
//
// The video frame under the overlay, as a texture.
#pragma once

#include <arhost/camera.h>
#include <arhost/frame.h>

#include <cstdint>
#include <vector>

namespace arhost::raytracer_common {

class VideoImage {
public:
    // Converts the frame.
    void set(const arhost_frame &frame);
    // R, G, B, A bytes, sRGB codes, top row first, without padding.
    const std::uint8_t *texels() const { return texels_.data(); }

private:
    std::vector<std::uint8_t> texels_;
};

// Returns the largest squared length of (x/z, y/z) of the directions in the picture: lens models are not valid far
// outside of it. Infinite for a camera without distortion.
float max_radius_squared(const arhost_intrinsics &intrinsics);

} // namespace arhost::raytracer_common
