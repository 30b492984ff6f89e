// SPDX-License-Identifier: Apache-2.0
//
// Something large and askew that goes through the origin, seen and lit from near.
#pragma once

#include "tracer.hpp"

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include <array>
#include <ostream>

namespace arhost::test {

struct LargeSurface {
    const char *name;
    bool is_sphere, is_scaled;
    double size_mm; // the sphere's radius, half the square's side
};
inline std::ostream &operator<<(std::ostream &stream, const LargeSurface &surface) {
    return stream << surface.name;
}

// A square of 10 m is a wall of a scanned room.
inline const LargeSurface large_surfaces[] = {
    {"Sphere1m", true, false, 1e3},          {"Sphere10m", true, false, 1e4},
    {"Sphere100m", true, false, 1e5},        {"Sphere1km", true, false, 1e6},
    {"Square1m", false, false, 1e3},         {"Square10m", false, false, 1e4},
    {"Square100m", false, false, 1e5},       {"Square1km", false, false, 1e6},
    {"SphereScaledTo100m", true, true, 1e5}, {"SquareScaledTo100m", false, true, 1e5}};

// Its columns: two directions in the surface at the origin, and out of it.
inline glm::dmat3 surface_axes() {
    const glm::dvec3 out = glm::normalize(glm::dvec3(0.31, -0.42, 0.85)),
                     right = glm::normalize(glm::cross(out, glm::dvec3(0.2, 0.9, 0.1)));
    return {right, glm::cross(out, right), out};
}

inline scene::ArenaBuilder scene_with(const LargeSurface &surface) {
    const glm::dmat3 axes = surface_axes();
    const double size = surface.is_scaled ? 1 : surface.size_mm;
    scene::ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(0);
    builder.settings.axes = ARHOST_Z_UP;
    std::uint32_t geometry = 0;
    if (surface.is_sphere) {
        geometry = builder.add_spheres({glm::vec4(glm::vec3(axes[2] * -size), static_cast<float>(size))});
    } else {
        scene::TriangleMesh mesh = square(1);
        for (glm::vec3 &p : mesh.positions)
            p = glm::vec3(axes * (size * (glm::dvec3(p) + glm::dvec3(0.3, -0.45, 0))));
        geometry = builder.add_triangles(std::move(mesh));
    }
    glm::mat4x3 world_from_object(1);
    if (surface.is_scaled)
        world_from_object = glm::mat4x3(static_cast<float>(surface.size_mm));
    builder.add_object("surface", geometry, builder.add_material(diffuse(1, 1, 1)), ARHOST_VIRTUAL,
                       world_from_object);
    const glm::dvec3 lamp = axes * glm::dvec3(200, 60, 300);
    builder.add_light(light(static_cast<float>(lamp.x), static_cast<float>(lamp.y), static_cast<float>(lamp.z), 1));
    return builder;
}

inline arhost_camera camera_at_surface() {
    const glm::dmat3 axes = surface_axes();
    const glm::dvec3 eye = axes * glm::dvec3(-40, 90, 150);
    return camera({eye.x, eye.y, eye.z}, {0, 0, 0}, {axes[1].x, axes[1].y, axes[1].z});
}

// All of it is in the light.
inline int dark_pixels(const Picture &picture) {
    int dark = 0;
    for (const Pixel &pixel : picture.pixels())
        dark += pixel[3] == 255 && pixel[0] < 150;
    return dark;
}

} // namespace arhost::test
