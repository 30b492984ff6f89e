// SPDX-License-Identifier: Apache-2.0
//
// Cameras, materials and shapes that the tests' scenes are made of.
//
// Most look at the origin from (0, 0, 200), world y up: then world x is right and y up in the image, and what
// is in the plane z = 0 has pixels of 1 mm (160×120 px, focal length 200 px).
#pragma once

#include "scene/arena.hpp"

#include <arhost/camera.h>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

namespace arhost::conformance {

arhost_intrinsics pinhole(std::uint32_t width = 160, std::uint32_t height = 120, double focal = 200);
arhost_camera camera(const glm::dvec3 &eye, const glm::dvec3 &look_at, const glm::dvec3 &up,
                     const arhost_intrinsics &intrinsics = pinhole());
arhost_camera from_front(const arhost_intrinsics &intrinsics = pinhole());

// Shown in its colour (linear light) whatever the lamps: ambient only, in a scene whose ambient light is 1.
arhost_material glowing(const glm::vec3 &colour);
arhost_material diffuse(const glm::vec3 &colour); // and as ambient colour
arhost_material mirror(float reflectivity);
arhost_material glass();

arhost_light lamp(const glm::vec3 &position, float intensity); // a point, without falloff

// A square in the plane z = `z`, seen from +z.
scene::TriangleMesh square(float half_side, float z);
scene::TriangleMesh box(const glm::vec3 &half_sides);
// About the origin, of radius 1, with normals; 2·slices·(stacks − 1) triangles. `shared`: vertices are; otherwise
// each triangle has three of its own.
scene::TriangleMesh ball(std::uint32_t stacks, std::uint32_t slices, bool shared = true);

// One sphere (centre and radius) in ambient light of 1.
scene::ArenaBuilder one_sphere(const glm::vec4 &sphere, const arhost_material &material = glowing(glm::vec3(0.5f)));

// A catcher at z = 0; the lamp at (150, 0, 200) throws the shadow of a ball, whose centre is (30, 0, 40), on
// the origin: 38 × 30 mm, which from_front sees beside the ball.
scene::ArenaBuilder ball_over_catcher(const arhost_material &ball);

// Everything at once: shadows, a mirror, lamps, an occluder. `moved`: all of it, by a rotation and translation.
scene::ArenaBuilder still_life(const glm::mat4 &moved = glm::mat4(1));
arhost_camera of_still_life(const arhost_intrinsics &intrinsics = pinhole(), const glm::dmat4 &moved = glm::dmat4(1));

} // namespace arhost::conformance
