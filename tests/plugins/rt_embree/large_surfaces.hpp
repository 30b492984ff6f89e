// SPDX-License-Identifier: Apache-2.0
//
// Scenes with large surfaces that pass through the origin. The camera and the light are near the origin, so rounding
// errors could make the surface shadow itself.
#pragma once

#include "scene/motion.hpp"
#include "tracer.hpp"

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include <ostream>

namespace arhost::test {

// How the surface's size and position are set.
enum class Placement { BUILT, MOVED, SCALED, SCALED_IN_MOTION, MORPHED };

struct LargeSurface {
    const char *name;
    bool is_sphere;
    double size_mm; // the sphere's radius, or half the square's side
    Placement placement = Placement::BUILT;
};
inline std::ostream &operator<<(std::ostream &stream, const LargeSurface &surface) {
    return stream << surface.name;
}

// Realistic scenes have surfaces of up to 20 m, such as the wall of a scanned hall.
inline const LargeSurface large_surfaces[] = {{"Sphere2m", true, 1e3},
                                              {"Sphere20m", true, 1e4},
                                              {"Sphere200m", true, 1e5},
                                              {"Sphere2km", true, 1e6},
                                              {"SphereScaledTo200m", true, 1e5, Placement::SCALED},
                                              {"SphereThatGrowsTo200m", true, 1e5, Placement::SCALED_IN_MOTION},
                                              {"Square2m", false, 1e3},
                                              {"Square20m", false, 1e4},
                                              {"Square200m", false, 1e5},
                                              {"Square2km", false, 1e6},
                                              {"SquareFrom200mAway", false, 1e3, Placement::MOVED},
                                              {"SquareScaledTo200m", false, 1e5, Placement::SCALED},
                                              {"SquareThatGrowsTo200m", false, 1e5, Placement::SCALED_IN_MOTION},
                                              {"SquareThatMorphsTo200m", false, 1e5, Placement::MORPHED}};

// Returns the surface's axes at the origin as columns: two tangents and the normal.
inline glm::dmat3 surface_axes() {
    const glm::dvec3 out = glm::normalize(glm::dvec3(0.31, -0.42, 0.85)),
                     right = glm::normalize(glm::cross(out, glm::dvec3(0.2, 0.9, 0.1)));
    return {right, glm::cross(out, right), out};
}

inline SceneBuilder scene_with(const LargeSurface &surface) {
    const glm::dmat3 axes = surface_axes();
    const bool is_built = surface.placement == Placement::BUILT || surface.placement == Placement::MOVED;
    const double size = is_built ? surface.size_mm : 1;
    const auto scale = static_cast<float>(surface.size_mm);
    const glm::dvec3 away = surface.placement == Placement::MOVED ? glm::dvec3(2e5, -1e5, 5e4) : glm::dvec3(0);

    SceneBuilder builder({.ambient = glm::vec3(0), .duration_s = 2});
    scene::Motion motion{.moves = surface.placement == Placement::SCALED_IN_MOTION,
                         .deforms = surface.placement == Placement::MORPHED};
    if (motion.moves || motion.deforms)
        motion.node = builder.add_node({.animated = true, .morph_weights = {0}});
    if (motion.moves)
        builder.add_channel({.node = motion.node,
                             .target = ARHOST_CHANNEL_SCALE,
                             .times = {0, 1},
                             .values = {1, 1, 1, scale, scale, scale}});
    if (motion.deforms)
        builder.add_channel(
            {.node = motion.node, .target = ARHOST_CHANNEL_MORPH_WEIGHTS, .times = {0, 1}, .values = {0, 1}});

    std::uint32_t geometry = 0;
    if (surface.is_sphere) {
        geometry = builder.add_spheres({glm::vec4(glm::vec3(axes[2] * -size), static_cast<float>(size))});
    } else {
        scene::TriangleMesh mesh = square(1);
        for (glm::vec3 &p : mesh.positions) {
            p = glm::vec3(axes * (size * (glm::dvec3(p) + glm::dvec3(0.3, -0.45, 0))) - away);
            if (motion.deforms)
                mesh.morph_positions.push_back(p * (scale - 1));
        }
        geometry = builder.add_triangles(std::move(mesh));
    }
    glm::mat4x3 world_from_object(surface.placement == Placement::SCALED ? scale : 1.0f);
    world_from_object[3] = glm::vec3(away);
    builder.add_object("surface", geometry, builder.add_material(diffuse(1, 1, 1)), ARHOST_ROLE_VIRTUAL,
                       world_from_object, motion);
    const glm::dvec3 lamp = axes * glm::dvec3(200, 60, 300);
    builder.add_light(light(static_cast<float>(lamp.x), static_cast<float>(lamp.y), static_cast<float>(lamp.z), 1));
    return builder;
}

inline arhost_camera camera_at_surface() {
    const glm::dmat3 axes = surface_axes();
    const glm::dvec3 eye = axes * glm::dvec3(-40, 90, 150);
    return camera({eye.x, eye.y, eye.z}, {0, 0, 0}, {axes[1].x, axes[1].y, axes[1].z});
}

// Returns a scene with a plate of 20 × 20 × 1 mm on a horizontal floor of `side_mm`. A low lamp is far to the left of
// the plate, so the plate's shadow is on its right and 5.8 mm long.
inline SceneBuilder plate_on_floor(float side_mm) {
    SceneBuilder builder({.ambient = glm::vec3(0)});
    const std::uint32_t white = builder.add_material(diffuse(1, 1, 1));
    builder.add_object("floor", builder.add_triangles(square(side_mm / 2)), white);
    scene::TriangleMesh plate = cube(10);
    for (glm::vec3 &p : plate.positions)
        p.z = p.z > 0 ? 1 : 0;
    builder.add_object("plate", builder.add_triangles(std::move(plate)), white);
    builder.add_light(light(-1000, 0, 175, 10));
    return builder;
}

// Whether the plate's shadow is on its right, and the floor on its left is lit.
inline bool has_its_shadow(const Picture &picture) {
    return picture.at(125, 74)[0] == 0 && picture.at(74, 74)[0] > 150;
}
inline arhost_camera camera_over_plate() {
    return camera({0, 0, 100}, {0, 0, 0}, {0, 1, 0});
}

// Renders the surface, which fills the picture and should be fully lit, and returns the number of pixels that are
// not.
inline int pixels_out_of_light(const LargeSurface &surface, const std::string &plugin, const Options &options = {}) {
    Tracer tracer(scene_with(surface), options, plugin);
    const arhost_camera camera = camera_at_surface();
    EXPECT_EQ(tracer.start(camera.intrinsics), ARHOST_STATUS_OK) << tracer.log();
    tracer.render_at(0, camera);
    const std::vector<Pixel> pixels = tracer.render_at(1, camera).pixels();
    return static_cast<int>(
        std::ranges::count_if(pixels, [](const Pixel &pixel) { return pixel[3] != 255 || pixel[0] < 150; }));
}

} // namespace arhost::test
