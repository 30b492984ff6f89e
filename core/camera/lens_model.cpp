// SPDX-License-Identifier: Apache-2.0
#include "camera/lens_model.hpp"

#include <arhost/shading/lens.hpp>

#include <glm/geometric.hpp>
#include <glm/gtc/type_ptr.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <span>

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

std::string problem_with_lens(const arhost_intrinsics &intrinsics) {
    if (intrinsics.distortion != ARHOST_DISTORTION_BROWN && intrinsics.distortion != ARHOST_DISTORTION_FISHEYE)
        return {};
    const std::span tilt = std::span(intrinsics.coefficients).subspan(untilted_coefficients);
    if (intrinsics.coefficient_count > untilted_coefficients &&
        std::ranges::any_of(tilt, [](double angle) { return angle != 0; }))
        return "a tilted sensor (tauX, tauY) is not supported; calibrate without CALIB_TILTED_MODEL";
    const shading::Lens lens(intrinsics);
    // The largest distance of a corner from the principal point, on the plane z = 1. A fisheye lens sees a hemisphere
    // at most near its centre.
    const double right = std::max(intrinsics.cx, intrinsics.width - 1 - intrinsics.cx),
                 bottom = std::max(intrinsics.cy, intrinsics.height - 1 - intrinsics.cy);
    const double near_centre = std::min(0.1 * std::hypot(right / intrinsics.fx, bottom / intrinsics.fy), 0.2);
    for (int direction = 0; direction < 8; ++direction) {
        const double angle = direction * std::numbers::pi / 4;
        const auto distorted = lens.distort({near_centre * std::cos(angle), near_centre * std::sin(angle), 1});
        const double scale = distorted ? std::hypot(distorted->x, distorted->y) / near_centre : 0;
        if (scale >= 0.5 && scale <= 2) // false for NaN
            continue;
        char what[64] = "folds the image";
        if (distorted)
            std::snprintf(what, sizeof what, "scales distances by %.3g", scale);
        return std::string("the lens distortion is implausible: near the principal point it ") + what +
               ", but lenses hardly distort there; correct its coefficients";
    }
    return {};
}

glm::dvec3 in_camera(const arhost_camera &camera, const glm::dvec3 &point_in_world) {
    const glm::dvec3 eye = glm::make_vec3(camera.eye);
    const glm::dvec3 w = glm::normalize(eye - glm::make_vec3(camera.look_at));
    const glm::dvec3 u = glm::normalize(glm::cross(glm::make_vec3(camera.up), w)), v = glm::cross(w, u);
    const glm::dvec3 p = point_in_world - eye;
    return {glm::dot(u, p), -glm::dot(v, p), -glm::dot(w, p)};
}

} // namespace arhost::camera
