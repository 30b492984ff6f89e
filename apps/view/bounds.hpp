// SPDX-License-Identifier: Apache-2.0
//
// The box around the virtual objects of a scene.
#pragma once

#include "scene/box.hpp"

#include <arhost/scene.h>

#include <span>

namespace arhost::view {

template <class T> std::span<const T> elements(const arhost_scene &scene, const arhost_buffer &buffer) {
    return {reinterpret_cast<const T *>(reinterpret_cast<const std::byte *>(&scene) + buffer.offset), buffer.count};
}

inline bool is_empty(const scene::Box &box) {
    return box.min.x > box.max.x;
}

// Returns the box in mm, at time 0 or over the whole animation, which is sampled; empty if the scene has no virtual
// objects. The scene must be valid.
scene::Box box_at_start(const arhost_scene &scene);
scene::Box box_over_animation(const arhost_scene &scene);

} // namespace arhost::view
