// SPDX-License-Identifier: Apache-2.0
//
// Light for scenes that describe none. Private to core/scene.
#pragma once

#include "scene/arena_builder.hpp"

namespace arhost::scene {

// An environment map of one column (RGBA32F) for arhost_environment::follows_video: a large soft lamp at the zenith
// and a uniform sky bring half of the irradiance of a horizontal surface each; the mean light of the video is below
// the horizon. A surface that reflects 35 % of the irradiance, about the mean of rooms, has the mean radiance of the
// video.
TexelImage default_light();

} // namespace arhost::scene
