// SPDX-License-Identifier: Apache-2.0
#include "scene/shapes.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <cmath>

namespace arhost::scene {

Transform Transform::scaling(const glm::dvec3 &factors) {
    glm::dmat3 linear(1);
    for (int i = 0; i < 3; ++i)
        linear[i][i] = factors[i];
    return {linear, glm::dvec3(0)};
}

// Rodrigues' formula: v cos a + (k × v) sin a + k (k·v)(1 − cos a).
Transform Transform::rotation(const glm::dvec3 &k, double degrees) {
    const double angle = glm::radians(std::fmod(degrees, 360.0));
    glm::dmat3 linear;
    for (int i = 0; i < 3; ++i) {
        glm::dvec3 axis(0);
        axis[i] = 1;
        linear[i] = axis * std::cos(angle) + glm::cross(k, axis) * std::sin(angle) + k * k[i] * (1 - std::cos(angle));
    }
    return {linear, glm::dvec3(0)};
}

std::optional<double> Transform::uniform_scale() const {
    const glm::dmat3 squared = glm::transpose(linear_) * linear_; // scale² · identity, if it is uniform
    const double scale_squared = (squared[0][0] + squared[1][1] + squared[2][2]) / 3;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            if (std::abs(squared[i][j] - (i == j ? scale_squared : 0)) > 1e-9 * scale_squared)
                return std::nullopt;
    return std::sqrt(scale_squared);
}

void Transform::apply(TriangleMesh &mesh) const {
    for (glm::vec3 &position : mesh.positions)
        position = (*this)(position);
    const glm::dmat3 normal_matrix = glm::transpose(glm::inverse(linear_));
    for (glm::vec3 &normal : mesh.normals)
        normal = glm::normalize(normal_matrix * glm::dvec3(normal));
    if (glm::determinant(linear_) < 0)
        for (glm::uvec3 &triangle : mesh.triangles)
            std::swap(triangle.y, triangle.z);
}

TriangleMesh cuboid(const glm::dvec3 &centre, const glm::dvec3 &size) {
    TriangleMesh mesh;
    for (int corner = 0; corner < 8; ++corner)
        mesh.positions.emplace_back(
            centre + size * glm::dvec3(corner & 1 ? 0.5 : -0.5, corner & 2 ? 0.5 : -0.5, corner & 4 ? 0.5 : -0.5));
    mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                      {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    return mesh;
}

TriangleMesh rectangle(const glm::dvec3 &centre, const glm::dvec3 &normal, const glm::dvec3 &up,
                       const glm::dvec2 &size) {
    glm::dvec3 across = glm::cross(up, normal);
    across = glm::length(across) > 1e-6 ? glm::normalize(across) : glm::dvec3(1, 0, 0);
    const glm::dvec3 along = glm::cross(normal, across);
    const glm::dvec3 u = across * (size.x / 2), v = along * (size.y / 2);
    TriangleMesh mesh;
    mesh.positions = {centre - u - v, centre + u - v, centre + u + v, centre - u + v};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    return mesh;
}

} // namespace arhost::scene
