// SPDX-License-Identifier: Apache-2.0
//
// A scene, or a model on the ground, as it is rendered.
#pragma once

#include "view/bounds.hpp"
#include "view/content.hpp"
#include "view/ground.hpp"

#include <glm/vec3.hpp>

#include <optional>

namespace arhost::view {

struct Stage {
    Content content;
    scene::Box box; // of the virtual objects, over the animation
    std::optional<scene::Arena> grounded{};

    const arhost_scene &scene() const { return grounded ? grounded->scene() : content.scene(); }
    glm::dvec3 up() const { return scene().axes == ARHOST_AXES_Z_UP ? glm::dvec3(0, 0, 1) : glm::dvec3(0, 1, 0); }
};

// `has_ground`: models need one; scene files have what they need.
inline Stage stage_of(Content content, bool has_ground) {
    Stage stage{std::move(content), {}};
    stage.box = box_over_animation(stage.content.scene());
    if (has_ground && !is_empty(stage.box))
        stage.grounded = with_ground(stage.content.scene(), stage.box);
    return stage;
}

} // namespace arhost::view
