// SPDX-License-Identifier: Apache-2.0
#include "conformance/projection.hpp"

#include <glm/geometric.hpp>

#include <cmath>
#include <numbers>
#include <vector>

namespace arhost::conformance {

glm::dvec3 in_camera(const arhost_camera &camera, const glm::dvec3 &world) {
    const glm::dvec3 eye(camera.eye[0], camera.eye[1], camera.eye[2]);
    const glm::dvec3 look_at(camera.look_at[0], camera.look_at[1], camera.look_at[2]);
    const glm::dvec3 up(camera.up[0], camera.up[1], camera.up[2]);
    const glm::dvec3 w = glm::normalize(eye - look_at), u = glm::normalize(glm::cross(up, w)), v = glm::cross(w, u);
    const glm::dvec3 d = world - eye;
    return {glm::dot(d, u), -glm::dot(d, v), -glm::dot(d, w)};
}

glm::dvec2 project(const arhost_intrinsics &in, const glm::dvec3 &point) {
    glm::dvec2 p(point.x / point.z, point.y / point.z);
    if (in.distortion == ARHOST_DISTORTION_BROWN) { // OpenCV's documentation of calib3d
        const double *k = in.coefficients;
        const double r2 = glm::dot(p, p),
                     radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * (in.coefficient_count > 4 ? k[4] : 0)));
        p = {p.x * radial + 2 * k[2] * p.x * p.y + k[3] * (r2 + 2 * p.x * p.x),
             p.y * radial + k[2] * (r2 + 2 * p.y * p.y) + 2 * k[3] * p.x * p.y};
    }
    return {in.fx * p.x + in.cx, in.fy * p.y + in.cy};
}

glm::dvec2 silhouette_centroid(const arhost_camera &camera, const glm::dvec3 &centre, double radius) {
    // The tangent rays of the sphere form a cone. Its outline in the image is approximated by a polygon, whose
    // centroid is that of the triangles between its edges and the origin.
    const glm::dvec3 c = in_camera(camera, centre), axis = glm::normalize(c);
    const glm::dvec3 a = glm::normalize(glm::cross(axis, glm::dvec3(0, 1, 0))), b = glm::cross(axis, a);
    const double angle = std::asin(radius / glm::length(c));
    constexpr int corners = 2000;
    std::vector<glm::dvec2> rim;
    rim.reserve(corners);
    for (int i = 0; i < corners; ++i) {
        const double phi = 2 * std::numbers::pi * i / corners;
        rim.push_back(project(camera.intrinsics,
                              axis * std::cos(angle) + (a * std::cos(phi) + b * std::sin(phi)) * std::sin(angle)));
    }
    double area = 0;
    glm::dvec2 moment(0);
    for (int i = 0; i < corners; ++i) {
        const glm::dvec2 p = rim[i], q = rim[(i + 1) % corners];
        const double cross = p.x * q.y - q.x * p.y;
        area += cross / 2;
        moment += (p + q) * (cross / 6);
    }
    return moment / area;
}

std::optional<glm::dvec2> centroid(const Picture &picture) {
    glm::dvec2 sum(0);
    int count = 0;
    for (std::uint32_t y = 0; y < picture.height(); ++y)
        for (std::uint32_t x = 0; x < picture.width(); ++x)
            if (picture.alpha(x, y) >= 128) {
                sum += glm::dvec2(x, y);
                ++count;
            }
    if (count == 0)
        return std::nullopt;
    return sum / static_cast<double>(count);
}

} // namespace arhost::conformance
