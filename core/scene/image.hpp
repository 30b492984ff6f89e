// SPDX-License-Identifier: Apache-2.0
//
// Images for textures and environments: PNG, JPEG, PNM, Radiance HDR and OpenEXR. Private to core/scene.
#pragma once

#include "scene/arena_builder.hpp"
#include "scene/callbacks.hpp"

#include <filesystem>
#include <span>
#include <stdexcept>
#include <string>

namespace arhost::scene {

// what() is one sentence for the user that starts with the file name.
class ImageError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

struct Image {
    std::uint32_t width = 0, height = 0;
    bool is_float = false; // true: RGBA floats, linear light, 0 to 1e6; false: RGBA bytes
    Texels texels;         // the top row is first
};

// Decodes `content`, the bytes of an image file, or reads `file` if `content` is empty. Converts integer channels to
// 8 bits and keeps floats. Expands grey to RGB; images without alpha become opaque. Throws ImageError.
Image read_image(const std::filesystem::path &file, std::span<const unsigned char> content, const Reporter &reporter);

// Converts to RGBA floats in linear light; decodes sRGB-encoded bytes.
Image linearized(Image image, const Reporter &reporter);

// Sets `rows` and `columns` to cumulative sums of luminance · sin(πv), for importance sampling. The luminance is the
// mean over a texel of the image as ray tracers interpolate it. `image` must be RGBA32F.
void add_cumulative_sums(Environment &environment, const TexelImage &image, const Reporter &reporter);

} // namespace arhost::scene
