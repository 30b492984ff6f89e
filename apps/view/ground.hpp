// SPDX-License-Identifier: Apache-2.0
//
// The ground that receives the shadow of a model.
#pragma once

#include "scene/arena_builder.hpp"
#include "scene/box.hpp"

namespace arhost::view {

// Returns a copy of the scene with a shadow catcher below `box`. The scene must be valid and have objects.
scene::Arena with_ground(const arhost_scene &scene, const scene::Box &box);

} // namespace arhost::view
