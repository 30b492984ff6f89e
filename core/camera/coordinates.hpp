// SPDX-License-Identifier: Apache-2.0
//
// The coordinate profiles of the dissertation (figure 7): which axes the tracker's world and the ray
// tracer's world have, and the rotations between them.
#pragma once

#include "yaml/yaml.hpp"

#include <arhost/scene.h>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include <string>
#include <vector>

namespace arhost::camera {

// Profiles of worlds, all right-handed. Their numbers are only compared.
inline constexpr int profile_z_up = 1; // x right, y back, z up: the marker's own
inline constexpr int profile_y_up = 2; // x right, y up, z front
inline constexpr int profile_other = 3;

struct Rotation {
    double degrees;  // counter-clockwise about `axis`
    glm::dvec3 axis; // of any length but 0
};

// Where `ar` and `rt` differ, MT becomes MT·R1·R2 before it is inverted; where they are equal, it stays.
struct Coordinates {
    int ar = profile_z_up;           // of the tracker's world
    int rt = profile_z_up;           // of the ray tracer's world, that is of the scene
    std::vector<Rotation> rotations; // R1, R2: none where ar equals rt, else one or two
};

// What the scene's declared axes ask for: nothing for z-up, 90° about x for y-up.
Coordinates default_for(arhost_axes scene_axes);

// "" where the coordinates can be used, else a sentence for the user that says what to mend.
std::string problem_with(const Coordinates &coordinates);

// {ar: 1, rt: 2, rotations: [{degrees: 90, axis: [1, 0, 0]}]}; throws yaml::Error.
Coordinates parse_coordinates(const yaml::Node &node);

// R1·R2, or the identity where the profiles are equal.
glm::dmat4 rotation_of(const Coordinates &coordinates);

} // namespace arhost::camera
