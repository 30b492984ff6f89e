// SPDX-License-Identifier: Apache-2.0
#include "camera/coordinates.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/vec4.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace arhost::camera {
namespace {

std::string problem_with(const Rotation &rotation) {
    if (!std::isfinite(rotation.degrees))
        return "the angle must be a finite number of degrees";
    const glm::dvec3 &axis = rotation.axis;
    if (!std::isfinite(axis.x) || !std::isfinite(axis.y) || !std::isfinite(axis.z))
        return "the axis must be three finite numbers";
    if (axis == glm::dvec3(0))
        return "the axis must not be (0, 0, 0); for the x axis, write [1, 0, 0]";
    return "";
}

std::string problem_with_profiles(const Coordinates &coordinates) {
    const auto &[ar, rt, rotations] = coordinates;
    if (std::min(ar, rt) < profile_z_up || std::max(ar, rt) > profile_other)
        return "the profiles ar and rt must be 1 (x right, y back, z up), 2 (x right, y up, z front) or 3 (other); "
               "they are " +
               std::to_string(ar) + " and " + std::to_string(rt);
    if (rotations.size() > 2)
        return "at most two rotations are allowed, not " + std::to_string(rotations.size());
    if (ar == rt && !rotations.empty())
        return "the profiles ar and rt are both " + std::to_string(ar) +
               ", so the rotations would have no effect; remove them, or set rt to the ray tracer's profile";
    if (ar != rt && rotations.empty())
        return "the profiles ar " + std::to_string(ar) + " and rt " + std::to_string(rt) +
               " differ, so a rotation is needed; from 1 to 2 it is 90 degrees about [1, 0, 0]";
    return "";
}

// Returns the cosine and sine, which are exact for multiples of 90°.
std::pair<double, double> cos_sin(double degrees) {
    const double reduced = std::remainder(degrees, 360.0); // -180 to 180
    if (reduced == 0)
        return {1, 0};
    if (std::abs(reduced) == 90)
        return {0, std::copysign(1.0, reduced)};
    if (std::abs(reduced) == 180)
        return {-1, 0};
    const double radians = reduced * (std::numbers::pi / 180);
    return {std::cos(radians), std::sin(radians)};
}

// Returns the rotation matrix, computed with Rodrigues' rotation formula.
glm::dmat4 matrix_of(const Rotation &rotation) {
    const glm::dvec3 size = glm::abs(rotation.axis);
    // Divides by the largest component first, so that squaring neither overflows nor underflows.
    const glm::dvec3 n = glm::normalize(rotation.axis / std::max({size.x, size.y, size.z}));
    const auto [c, s] = cos_sin(rotation.degrees);
    const glm::dvec3 t = (1 - c) * n;
    return {glm::dvec4(c + t.x * n.x, t.x * n.y + s * n.z, t.x * n.z - s * n.y, 0),
            glm::dvec4(t.y * n.x - s * n.z, c + t.y * n.y, t.y * n.z + s * n.x, 0),
            glm::dvec4(t.z * n.x + s * n.y, t.z * n.y - s * n.x, c + t.z * n.z, 0), glm::dvec4(0, 0, 0, 1)};
}

} // namespace

Coordinates default_for(arhost_axes scene_axes) {
    if (scene_axes == ARHOST_AXES_Y_UP)
        return {profile_z_up, profile_y_up, {{90, {1, 0, 0}}}};
    return {};
}

std::string problem_with(const Coordinates &coordinates) {
    for (std::size_t i = 0; i < coordinates.rotations.size(); ++i)
        if (const std::string problem = problem_with(coordinates.rotations[i]); !problem.empty())
            return "rotation " + std::to_string(i + 1) + ": " + problem;
    return problem_with_profiles(coordinates);
}

Coordinates parse_coordinates(const yaml::Node &node) {
    node.allow_keys({"ar", "rt", "rotations"});
    Coordinates coordinates;
    coordinates.ar = static_cast<int>(node.require("ar").integer(profile_z_up, profile_other));
    coordinates.rt = static_cast<int>(node.require("rt").integer(profile_z_up, profile_other));
    if (const auto rotations = node.find("rotations"))
        for (const yaml::Node &item : rotations->items()) {
            item.allow_keys({"degrees", "axis"});
            const yaml::Node axis = item.require("axis");
            const std::vector<double> n = axis.reals(3);
            coordinates.rotations.push_back({item.require("degrees").real(), {n[0], n[1], n[2]}});
            if (const std::string problem = problem_with(coordinates.rotations.back()); !problem.empty())
                axis.fail(problem);
        }
    if (const std::string problem = problem_with_profiles(coordinates); !problem.empty())
        node.fail(problem);
    return coordinates;
}

glm::dmat4 rotation_of(const Coordinates &coordinates) {
    glm::dmat4 product(1);
    if (coordinates.ar != coordinates.rt)
        for (const Rotation &rotation : coordinates.rotations)
            product = product * matrix_of(rotation);
    return product;
}

} // namespace arhost::camera
