// SPDX-License-Identifier: Apache-2.0
//
// Images for textures and environments: PNG, JPEG, PNM, Radiance HDR and OpenEXR. Private to core/scene.
#pragma once

#include "scene/arena.hpp"
#include "scene/mesh_text.hpp"

#include <filesystem>
#include <span>
#include <stdexcept>
#include <string>

namespace arhost::scene {

// what() is one sentence for the user that begins with the file.
class ImageError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

struct Image {
    std::uint32_t width = 0, height = 0;
    bool is_float = false; // four floats a texel, linear light, 0 to 1e6; else R, G, B, A bytes
    Texels texels;         // first row at the top
};

// Of files with more than 8 bits a channel, integers become bytes and floats stay floats. Grey and missing
// alpha are filled in. `content` may be empty: then the file is read.
Image read_image(const std::filesystem::path &file, std::span<const unsigned char> content, const Watch &watch);

// Four floats a texel, linear light: sRGB-encoded bytes are decoded.
Image linearised(Image image, const Watch &watch);

// Cumulative sums of luminance · sin(πv) for choosing directions. `texture` is RGBA32F.
void add_cumulative_sums(Environment &environment, const Texture &texture, const Watch &watch);

} // namespace arhost::scene
