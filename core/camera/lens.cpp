// SPDX-License-Identifier: Apache-2.0
#include "camera/lens.hpp"

#include <glm/geometric.hpp>
#include <glm/gtc/type_ptr.hpp>

#include <cmath>

namespace arhost::camera {
namespace {

// OpenCV 4.6, calib3d, "Detailed Description". Coefficients past the count are 0.
glm::dvec2 brown(const double (&k)[ARHOST_MAX_DISTORTION], const glm::dvec2 &p) {
    const auto &[k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4] = k;
    const double r2 = glm::dot(p, p), r4 = r2 * r2, r6 = r4 * r2;
    const double radial = (1 + k1 * r2 + k2 * r4 + k3 * r6) / (1 + k4 * r2 + k5 * r4 + k6 * r6);
    return {p.x * radial + 2 * p1 * p.x * p.y + p2 * (r2 + 2 * p.x * p.x) + s1 * r2 + s2 * r4,
            p.y * radial + p1 * (r2 + 2 * p.y * p.y) + 2 * p2 * p.x * p.y + s3 * r2 + s4 * r4};
}

// OpenCV 4.6, calib3d, "Fisheye camera model"; after Kannala and Brandt, IEEE PAMI 28(8), 2006.
glm::dvec2 fisheye(const double (&k)[ARHOST_MAX_DISTORTION], const glm::dvec2 &p) {
    const double r = glm::length(p);
    if (r < 1e-8)
        return p;
    const double theta = std::atan(r), t2 = theta * theta;
    return p * (theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3])))) / r);
}

glm::dvec2 distort(const arhost_intrinsics &intrinsics, const glm::dvec2 &p) {
    switch (intrinsics.distortion) {
    case ARHOST_DISTORTION_BROWN:
        return brown(intrinsics.coefficients, p);
    case ARHOST_DISTORTION_FISHEYE:
        return fisheye(intrinsics.coefficients, p);
    default:
        return p;
    }
}

} // namespace

std::optional<glm::dvec2> project(const arhost_intrinsics &intrinsics, const glm::dvec3 &point_in_camera) {
    if (!(point_in_camera.z > 0))
        return std::nullopt;
    const glm::dvec2 p = distort(intrinsics, glm::dvec2(point_in_camera) / point_in_camera.z);
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
