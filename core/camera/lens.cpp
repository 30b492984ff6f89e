// SPDX-License-Identifier: Apache-2.0
#include "camera/lens.hpp"

#include <arhost/shading/lens.hpp>

#include <glm/geometric.hpp>
#include <glm/gtc/type_ptr.hpp>

namespace arhost::camera {
namespace {

// Returns the distorted normalized image coordinates (x'', y'') of a direction with z > 0.
glm::dvec2 distort(const arhost_intrinsics &intrinsics, const glm::dvec3 &d) {
    shading::Vec3 p{d.x / d.z, d.y / d.z, 1};
    if (intrinsics.distortion == ARHOST_DISTORTION_BROWN)
        p = brown_conrady(shading::brown_conrady_of(intrinsics), p);
    else if (intrinsics.distortion == ARHOST_DISTORTION_FISHEYE)
        p = kannala_brandt(shading::kannala_brandt_of(intrinsics), p);
    return {p.x, p.y};
}

} // namespace

std::optional<glm::dvec2> project(const arhost_intrinsics &intrinsics, const glm::dvec3 &point_in_camera) {
    if (!(point_in_camera.z > 0))
        return std::nullopt;
    const glm::dvec2 p = distort(intrinsics, point_in_camera);
    return glm::dvec2(intrinsics.fx * p.x + intrinsics.cx, intrinsics.fy * p.y + intrinsics.cy);
}

glm::dvec3 in_camera(const arhost_camera &camera, const glm::dvec3 &point_in_world) {
    const glm::dvec3 eye = glm::make_vec3(camera.eye);
    const glm::dvec3 w = glm::normalize(eye - glm::make_vec3(camera.look_at));
    const glm::dvec3 u = glm::normalize(glm::cross(glm::make_vec3(camera.up), w)), v = glm::cross(w, u);
    const glm::dvec3 p = point_in_world - eye;
    return {glm::dot(u, p), -glm::dot(v, p), -glm::dot(w, p)};
}

} // namespace arhost::camera
