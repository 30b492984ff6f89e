// SPDX-License-Identifier: Apache-2.0
//
// The coordinate profiles of the dissertation (figure 7): the directions of the axes in the tracker's and the ray
// tracer's world coordinates, and the rotations between the two.
#pragma once

#include "yaml/yaml.hpp"

#include <arhost/scene.h>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include <string>
#include <vector>

namespace arhost::camera {

// Profiles: directions of the world axes, all right-handed. Profile numbers are only compared for equality.
inline constexpr int profile_z_up = 1; // x right, y back, z up: the marker frame
inline constexpr int profile_y_up = 2; // x right, y up, z front
inline constexpr int profile_other = 3;

struct Rotation {
    double degrees;  // counter-clockwise about `axis`
    glm::dvec3 axis; // any length except 0
};

// If `ar` and `rt` differ, MT (the marker's pose) is replaced with MT·R1·R2 before it is inverted; if they are equal,
// MT is used unchanged.
struct Coordinates {
    int ar = profile_z_up;           // profile of the tracker's world
    int rt = profile_z_up;           // profile of the ray tracer's world, i.e. of the scene
    std::vector<Rotation> rotations; // R1, R2: empty if `ar` equals `rt`, otherwise one or two rotations
};

// Returns the default for a scene's axes: no rotation for z-up, 90° about x for y-up.
Coordinates default_for(arhost_axes scene_axes);

// Returns "" if the coordinates are valid, otherwise a message that says how to fix them.
std::string problem_with(const Coordinates &coordinates);

// Reads, for example, {ar: 1, rt: 2, rotations: [{degrees: 90, axis: [1, 0, 0]}]}. Throws yaml::Error.
Coordinates parse_coordinates(const yaml::Node &node);

// Returns R1·R2, or the identity if the profiles are equal.
glm::dmat4 rotation_of(const Coordinates &coordinates);

} // namespace arhost::camera
