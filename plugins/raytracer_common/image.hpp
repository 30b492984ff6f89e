// SPDX-License-Identifier: Apache-2.0
//
// Images, textures and cameras as SIMD code reads and writes them: plain data, because that code is compiled once per
// instruction set and must not share inline functions with other code (packets/packet.hpp).
#pragma once

#include <arhost/camera.h>
#include <arhost/scene.h>
#include <arhost/shading/srgb8.hpp>

#include <cstdint>

namespace arhost::raytracer_common {

struct Rectangle {
    std::int32_t x0, y0, x1, y1; // px; x1 and y1 are exclusive
};

struct Camera {
    float eye[3];
    float world_from_camera[9]; // column-major
};

struct Texture {
    const void *texels; // per texel: RGBA with 8 bits per channel (sRGB or linear), or four floats
    std::int32_t width, height;
    arhost_texel_format format;
    arhost_wrap wrap_u, wrap_v;
    bool is_nearest = false; // not filtered
    // Set of texture coordinates, and (u, v) from them (arhost_texture).
    std::uint32_t texcoord_set = 0;
    float image_from_texcoord[6] = {1, 0, 0, 1, 0, 0};
    // Smaller versions of the image, for surfaces that are far away (arhost_texel_image).
    std::int32_t level_count = 1, first_of_level[15] = {}; // index of the first texel of each level
};

// The video under the overlay, undistorted coordinates to pixels as in arhost/camera.h.
struct Video {
    Texture image;                // sRGB codes; `texels` is NULL if there is no video
    const float *linear_of_srgb8; // linear value of each of the 256 sRGB codes
    float fx, fy, cx, cy;
    arhost_distortion distortion;
    float coefficients[ARHOST_MAX_DISTORTION];
    float max_radius_squared;        // of (x/z, y/z) in the picture; the lens model is not valid beyond
    float pixel_width, pixel_height; // of the overlay's pixels, whose grid covers the video, relative to its size
};

// Where an image is written.
struct Image {
    std::uint8_t *rgba; // NULL if the image is linear (arhost_image)
    std::uint32_t stride;
    std::uint16_t *linear;
    bool blends_codes; // straight images of the path integrator: the host blends sRGB codes, not linear light
    const shading::Srgb8Table *srgb8;
};

} // namespace arhost::raytracer_common
