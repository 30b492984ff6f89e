// SPDX-License-Identifier: Apache-2.0
//
// A camera that orbits a point.
#pragma once

#include "scene/box.hpp"

#include <arhost/camera.h>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <cstdint>

namespace arhost::view {

struct Lens {
    double vertical_degrees = 45; // field of view
    std::uint32_t width = 800, height = 600;
    double focal_px() const;
    bool operator==(const Lens &) const = default;
};

class Orbit {
public:
    // Looks at `target` from `eye`. `up` must not be 0.
    Orbit(const glm::dvec3 &eye, const glm::dvec3 &target, const glm::dvec3 &up);
    // Looks at the middle of a box from the front, from the right and from above, at the distance at which its
    // corners fill the picture; if `from_all_sides`, from every direction to which turn() leads. An empty box counts
    // as 100 mm.
    Orbit(const scene::Box &box, const glm::dvec3 &up, const Lens &lens, bool from_all_sides = false);

    void turn(double right_degrees, double up_degrees); // the camera, around the target; not beyond the poles
    void zoom(double factor);                           // multiplies the distance
    void pan(double right_px, double down_px, const Lens &lens); // moves what is seen at the target by these pixels

    glm::dvec3 eye() const;
    const glm::dvec3 &target() const { return target_; }
    arhost_camera camera(const Lens &lens) const;
    bool operator==(const Orbit &) const = default;

private:
    // Axes of the camera in the world, unit vectors.
    glm::dvec3 back() const; // from the target to the eye
    glm::dvec3 right() const;
    glm::dvec3 up() const { return glm::cross(back(), right()); }

    glm::dvec3 target_;
    glm::dmat3 axes_;                       // right, up and front of the world
    double azimuth_, elevation_, distance_; // radians, mm
};

} // namespace arhost::view
