// SPDX-License-Identifier: Apache-2.0
//
// Images for textures and environments: PNG, JPEG, PNM, Radiance HDR and OpenEXR. Private to core/scene.
#pragma once

#include "scene/arena.hpp"
#include "scene/callbacks.hpp"

#include <filesystem>
#include <span>
#include <stdexcept>
#include <string>

namespace arhost::scene {

// what() is one sentence for the user that starts with the file.
class ImageError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

struct Image {
    std::uint32_t width = 0, height = 0;
    bool is_float = false; // RGBA floats, linear light, 0 to 1e6; else RGBA bytes
    Texels texels;         // first row at the top
};

// Converts integers to 8 bits and keeps floats. Expands grey to RGB and missing alpha to opaque. Reads the file
// if `content` is empty. Throws ImageError.
Image read_image(const std::filesystem::path &file, std::span<const unsigned char> content, const Reporter &reporter);

// Converts to RGBA floats in linear light; decodes sRGB-encoded bytes.
Image linearized(Image image, const Reporter &reporter);

// Cumulative sums of luminance · sin(πv) for importance sampling. `texture` is RGBA32F.
void add_cumulative_sums(Environment &environment, const Texture &texture, const Reporter &reporter);

} // namespace arhost::scene
