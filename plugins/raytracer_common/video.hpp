// SPDX-License-Identifier: Apache-2.0
//
// The video frame under the overlay, as a texture.
#pragma once

#include "raytracer_common/image.hpp"

#include <arhost/camera.h>
#include <arhost/frame.h>
#include <arhost/scene.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace arhost::raytracer_common {

class VideoImage {
public:
    // Converts the frame.
    void set(const arhost_frame &frame);
    // R, G, B, A bytes, sRGB codes, top row first, without padding.
    const std::uint8_t *texels() const { return texels_.data(); }
    // The mean colour in linear light, of every fourth pixel in both directions.
    std::array<float, 3> mean() const;

private:
    std::size_t width_ = 0, height_ = 0;
    std::vector<std::uint8_t> texels_;
};

// Returns the factors by which the texels of an environment are multiplied. `video`: NULL if it is unknown.
std::array<float, 3> environment_scale(const arhost_environment &environment, const VideoImage *video);

// The tables that images and textures need.
struct ColourTables {
    shading::Srgb8Table srgb8;
    std::array<float, 256> linear_of_srgb8; // linear value of each sRGB code
    ColourTables();
};

// Returns a video through a lens, without texels, under an overlay of the same size. `tables` must outlive the
// result.
Video video_through(const arhost_intrinsics &intrinsics, const ColourTables &tables);

// Returns the largest squared length of (x/z, y/z) of the directions in the picture: lens models are not valid far
// outside of it. Infinite for a camera without distortion.
float max_radius_squared(const arhost_intrinsics &intrinsics);

} // namespace arhost::raytracer_common
