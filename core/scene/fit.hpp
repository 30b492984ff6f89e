// SPDX-License-Identifier: Apache-2.0
//
// How a model of any size is placed: the keys `unit`, `fit_mm` and `place` of scenes. Private to core/scene.
#pragma once

#include "scene/box.hpp"
#include "scene/shapes.hpp"

#include <algorithm>
#include <optional>
#include <string>

namespace arhost::scene {

struct Fit {
    enum class Place { as_is, on_ground, centred };
    double mm_per_unit = 1;
    std::optional<double> largest_side_mm; // replaces mm_per_unit
    Place place = Place::as_is;

    bool needs_box() const { return largest_side_mm || place != Place::as_is; }

    // Returns the transform of the model to mm. `box`: of the model, in its own unit and the axes of the scene; not
    // used unless needs_box(). `up`: a unit vector along an axis.
    Transform transform(const Box &box, const glm::dvec3 &up) const {
        const glm::dvec3 size = glm::dvec3(box.max) - glm::dvec3(box.min),
                         middle = (glm::dvec3(box.min) + glm::dvec3(box.max)) * 0.5;
        const double largest = std::max({size.x, size.y, size.z});
        const double scale = largest_side_mm && largest > 0 ? *largest_side_mm / largest : mm_per_unit;
        glm::dvec3 origin(0);
        if (place != Place::as_is)
            origin = place == Place::centred ? middle : middle - size * up * 0.5;
        return Transform::scaling(glm::dvec3(scale)) * Transform::translation(-origin);
    }
};

// Returns a warning that a placed model has an unlikely size or is below the ground, or "". `box`: in mm.
std::string placement_warning(const Box &box, const glm::dvec3 &up);

} // namespace arhost::scene
