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
    const glm::dmat3 squared = glm::transpose(linear_) * linear_; // equals scale² · identity if the scale is uniform
    const double scale_squared = (squared[0][0] + squared[1][1] + squared[2][2]) / 3;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            if (std::abs(squared[i][j] - (i == j ? scale_squared : 0)) > 1e-9 * scale_squared)
                return std::nullopt;
    return std::sqrt(scale_squared);
}

glm::dmat4 Transform::matrix() const {
    glm::dmat4 matrix(linear_);
    matrix[3] = glm::dvec4(offset_, 1);
    return matrix;
}

void Transform::apply(TriangleMesh &mesh) const {
    for (glm::vec3 &position : mesh.positions)
        position = (*this)(position);
    const glm::dmat3 normal_matrix = glm::transpose(glm::inverse(linear_));
    for (glm::vec3 &normal : mesh.normals)
        normal = glm::normalize(normal_matrix * glm::dvec3(normal));
    for (glm::vec4 &tangent : mesh.tangents)
        if (const glm::dvec3 along = linear_ * glm::dvec3(tangent); glm::length(along) > 0)
            tangent = glm::vec4(glm::normalize(along), tangent.w);
    if (glm::determinant(linear_) < 0) {
        for (glm::uvec3 &triangle : mesh.triangles)
            std::swap(triangle.y, triangle.z);
        for (glm::vec4 &tangent : mesh.tangents)
            tangent.w = -tangent.w;
    }
}

TriangleMesh rectangle(const glm::dvec3 &centre, const glm::dvec3 &normal, const glm::dvec3 &up,
                       const glm::dvec2 &size) {
    glm::dvec3 across = glm::cross(up, normal);
    across = glm::length(across) > 1e-6 ? glm::normalize(across) : glm::dvec3(1, 0, 0);
    const glm::dvec3 along = glm::cross(normal, across);
    const glm::dvec3 u = across * (size.x / 2), v = along * (size.y / 2);
    TriangleMesh mesh;
    mesh.positions = {centre - u - v, centre + u - v, centre + u + v, centre - u + v};
    mesh.texcoords = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    return mesh;
}

TriangleMesh cuboid(const glm::dvec3 &centre, const glm::dvec3 &up, const glm::dvec3 &size) {
    TriangleMesh mesh;
    for (int axis = 0; axis < 3; ++axis)
        for (const double side : {-0.5, 0.5}) {
            glm::dvec3 normal(0), middle(centre);
            normal[axis] = side * 2;
            middle[axis] += side * size[axis];
            // The axes of the face's width and height.
            const bool horizontal = glm::dot(up, normal) != 0;
            const int along = horizontal ? 3 - axis : up.z != 0 ? 2 : 1, across = 3 - axis - along;
            const glm::dvec2 extent =
                horizontal ? glm::dvec2(size.x, size[along]) : glm::dvec2(size[across], size[along]);
            const TriangleMesh face = rectangle(middle, normal, up, extent);
            const auto first = static_cast<std::uint32_t>(mesh.positions.size());
            mesh.positions.insert(mesh.positions.end(), face.positions.begin(), face.positions.end());
            mesh.texcoords.insert(mesh.texcoords.end(), face.texcoords.begin(), face.texcoords.end());
            for (const glm::uvec3 &triangle : face.triangles)
                mesh.triangles.push_back(triangle + first);
        }
    return mesh;
}

} // namespace arhost::scene
