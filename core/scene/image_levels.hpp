// SPDX-License-Identifier: Apache-2.0
//
// Smaller versions of images, for surfaces that are far away. Private to core/scene.
#pragma once

#include "scene/arena_builder.hpp"

#include <algorithm>
#include <bit>

namespace arhost::scene {

// The number of levels down to one texel.
inline std::uint32_t levels_of(const TexelImage &image) {
    return static_cast<std::uint32_t>(std::bit_width(std::max(image.width, image.height)));
}

// Appends all smaller levels, down to one texel, to an image of one level (arhost_texel_image).
void add_levels(TexelImage &image);

} // namespace arhost::scene
