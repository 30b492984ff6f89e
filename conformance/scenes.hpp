// SPDX-License-Identifier: Apache-2.0
// Cameras, materials and shapes for the tests' scenes.
// Most cameras look at the origin from (0, 0, 200) with world y up: world x points right and y up in the image, and a
// pixel covers 1 mm in the plane z = 0 (160×120 px, focal length 200 px).
#pragma once

#include "scene/arena_builder.hpp"

#include <arhost/camera.h>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

namespace arhost::conformance {

arhost_intrinsics pinhole(std::uint32_t width = 160, std::uint32_t height = 120, double focal = 200);
arhost_camera camera(const glm::dvec3 &eye, const glm::dvec3 &look_at, const glm::dvec3 &up,
                     const arhost_intrinsics &intrinsics = pinhole());
arhost_camera from_front(const arhost_intrinsics &intrinsics = pinhole());

// A material that reflects only ambient light. In a scene with ambient light 1, it has this colour (linear light),
// whatever the lamps.
arhost_material glowing(const glm::vec3 &colour);
arhost_material diffuse(const glm::vec3 &colour); // also as ambient colour
arhost_material emissive(const glm::vec3 &radiance);
arhost_material mirror(float reflectivity);
arhost_material glass();

arhost_light lamp(const glm::vec3 &position, float intensity); // a point light without falloff

// A square in the plane z = `z` that faces +z.
scene::TriangleMesh square(float half_side, float z);
scene::TriangleMesh box(const glm::vec3 &half_sides);
// A unit ball around the origin with normals; 2·slices·(stacks − 1) triangles, which share vertices if `shared`.
scene::TriangleMesh ball(std::uint32_t stacks, std::uint32_t slices, bool shared = true);

// One sphere (centre and radius) in ambient light 1.
scene::ArenaBuilder one_sphere(const glm::vec4 &sphere, const arhost_material &material = glowing(glm::vec3(0.5f)));

// A catcher at z = 0. The lamp at (150, 0, 200) casts the shadow of a ball at (30, 0, 40) on the origin: 38 × 30 mm,
// next to the ball in from_front's image.
scene::ArenaBuilder ball_over_catcher(const arhost_material &ball);

// A scene for ARHOST_INTEGRATOR_PATH without ambient light. `background`: the radiance of an environment.
scene::ArenaBuilder path_scene(float background = 0);
// Adds a catcher of 800 mm × 800 mm in the plane z = 0.
void add_table(scene::ArenaBuilder &builder);

// Shadows, a mirror, lamps and an occluder. `moved`: a rigid transform of the whole scene. `is_matte`: all materials
// are diffuse, for ray tracers without ARHOST_RAYTRACER_CAPABILITY_REFLECTION.
scene::ArenaBuilder still_life(const glm::mat4 &moved = glm::mat4(1), bool is_matte = false);
arhost_camera still_life_camera(const arhost_intrinsics &intrinsics = pinhole(),
                                const glm::dmat4 &moved = glm::dmat4(1));

} // namespace arhost::conformance
