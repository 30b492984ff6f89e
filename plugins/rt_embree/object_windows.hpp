// SPDX-License-Identifier: Apache-2.0
//
// Where the objects of a scene may be in the picture: the bounding rectangles of their projections.
#pragma once

#include "embree_scene.hpp"
#include "ray_table.hpp"
#include "raytracer_common/view.hpp"

#include <cstdint>
#include <vector>

namespace rt_embree {

class ObjectWindows {
public:
    // `has_plane`: the directions of rays have z = 1 in camera axes. Else the windows of Scratch are unknown.
    ObjectWindows(const EmbreeScene &scene, const arhost::raytracer_common::Pose &pose, bool has_plane);

    // The index of the largest flat catcher, such as a table; −1: there is none.
    std::int32_t wide_catcher() const { return wide_catcher_; }
    // Returns whether a tile may show a virtual object or a catcher.
    bool may_affect(const Window &tile) const;
    // Finds the windows that the tile intersects.
    void select(const Window &tile, Scratch &scratch) const;

private:
    std::vector<Window> virtual_, catchers_; // without the wide catcher
    Window wide_{};
    std::int32_t wide_catcher_ = -1;
    bool has_plane_, has_occluders_;
};

} // namespace rt_embree
