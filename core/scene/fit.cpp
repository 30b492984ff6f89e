// SPDX-License-Identifier: Apache-2.0
#include "scene/fit.hpp"

#include <glm/geometric.hpp>

#include <cstdio>

namespace arhost::scene {

std::string placement_warning(const Box &box, const glm::dvec3 &up) {
    constexpr double small_mm = 5, large_mm = 5000;
    const glm::dvec3 size = glm::dvec3(box.max) - glm::dvec3(box.min);
    const double largest = std::max({size.x, size.y, size.z}), top = glm::dot(up, glm::dvec3(box.max));
    char text[160] = "";
    if (largest < small_mm)
        std::snprintf(
            text, sizeof text,
            "is only %.3g mm large; if its unit is not mm, add 'unit: m', or set its size with 'fit_mm: 100'",
            largest);
    else if (largest > large_mm)
        std::snprintf(text, sizeof text, "is %.3g m large; set its size with 'fit_mm: 100', or its 'unit'",
                      largest / 1000);
    else if (top < 0)
        std::snprintf(text, sizeof text,
                      "is below the ground: its highest point is at %.3g mm; add 'place: on_ground'", top);
    return text;
}

} // namespace arhost::scene
