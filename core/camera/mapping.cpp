// SPDX-License-Identifier: Apache-2.0
#include "camera/mapping.hpp"

#include <glm/geometric.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <glm/matrix.hpp>
#include <glm/vec4.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace arhost::camera {

const char *problem_with(std::span<const double, 16> mt) {
    constexpr double tolerance = 1e-6, distance_limit_mm = 1e9;
    if (!std::ranges::all_of(mt, [](double x) { return std::isfinite(x); }))
        return "the pose is not finite";
    if (mt[3] != 0 || mt[7] != 0 || mt[11] != 0 || mt[15] != 1)
        return "the pose's last row is not 0 0 0 1";
    const glm::dmat3 rotation(glm::make_mat4(mt.data()));
    for (int i = 0; i < 3; ++i)
        for (int j = i; j < 3; ++j)
            if (!(std::abs(glm::dot(rotation[i], rotation[j]) - (i == j)) <= tolerance))
                return "the pose's rotation is not orthonormal";
    if (glm::determinant(rotation) < 0)
        return "the pose's rotation is left-handed";
    if (std::max({std::abs(mt[12]), std::abs(mt[13]), std::abs(mt[14])}) > distance_limit_mm)
        return "the pose is more than 1000 km from the camera";
    return nullptr;
}

std::optional<arhost_camera> camera_from_marker(std::span<const double, 16> mt, const Coordinates &coordinates,
                                                const arhost_intrinsics &intrinsics) {
    if (problem_with(mt))
        return std::nullopt;
    const glm::dmat4 cp =
        glm::inverse(glm::make_mat4(mt.data()) * rotation_of(coordinates));    // equation 3.2 of the dissertation
    const glm::dvec3 eye(cp[3]), look_at = eye - glm::dvec3(cp[2]), up(cp[1]); // equations 3.3 to 3.5
    arhost_camera camera{};
    camera.struct_size = sizeof camera;
    for (int i = 0; i < 3; ++i) {
        camera.eye[i] = eye[i];
        camera.look_at[i] = look_at[i];
        camera.up[i] = up[i];
    }
    camera.intrinsics = intrinsics;
    return camera;
}

glm::dmat4 scene_from_target(const arhost_camera &camera, std::span<const double, 16> mt,
                             const Coordinates &coordinates) {
    const glm::dvec3 eye = glm::make_vec3(camera.eye), z = glm::normalize(eye - glm::make_vec3(camera.look_at)),
                     x = glm::normalize(glm::cross(glm::make_vec3(camera.up), z));
    const glm::dmat4 scene_from_camera(glm::dvec4(x, 0), glm::dvec4(glm::cross(z, x), 0), glm::dvec4(z, 0),
                                       glm::dvec4(eye, 1));
    return scene_from_camera * glm::make_mat4(mt.data()) * rotation_of(coordinates);
}

} // namespace arhost::camera
