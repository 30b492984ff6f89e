// SPDX-License-Identifier: Apache-2.0
//
// Smaller versions of images, for surfaces that are far away. Private to core/scene.
#pragma once

#include "scene/arena_builder.hpp"

namespace arhost::scene {

// Appends all smaller levels, down to one texel, to an image of one level (arhost_texel_image).
void add_levels(TexelImage &image);

} // namespace arhost::scene
