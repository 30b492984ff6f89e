// SPDX-License-Identifier: Apache-2.0
//
// Transforms that are applied to vertices during loading, and the built-in shapes of scene files. Private to
// core/scene.
#pragma once

#include "scene/mesh.hpp"

#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include <optional>

namespace arhost::scene {

// p → linear · p + offset. Products apply from right to left.
class Transform {
public:
    Transform() = default;
    static Transform translation(const glm::dvec3 &by) { return {glm::dmat3(1), by}; }
    static Transform scaling(const glm::dvec3 &factors);
    static Transform rotation(const glm::dvec3 &unit_axis, double degrees); // right-handed
    static Transform of(const glm::dmat4 &matrix) { return {glm::dmat3(matrix), glm::dvec3(matrix[3])}; }

    friend Transform operator*(const Transform &b, const Transform &a) {
        return {b.linear_ * a.linear_, b.linear_ * a.offset_ + b.offset_};
    }
    glm::dmat4 matrix() const;
    glm::dvec3 operator()(const glm::dvec3 &point) const { return linear_ * point + offset_; }

    // Returns the scale factor, or std::nullopt if it depends on the direction.
    std::optional<double> uniform_scale() const;

    // Transforms positions and tangents, and normals by the inverse transpose. If the transform mirrors, flips the
    // winding, so front faces remain front faces.
    void apply(TriangleMesh &mesh) const;

private:
    Transform(const glm::dmat3 &linear, const glm::dvec3 &offset) : linear_(linear), offset_(offset) {}
    glm::dmat3 linear_{1};
    glm::dvec3 offset_{0};
};

// Returns two triangles that are counter-clockwise seen from the side to which `unit_normal` points. size.x is the
// length of the horizontal side; the other side points as much as possible along `up`. If the rectangle itself is
// horizontal, its sides are along x and along y (z-up scenes) or −z (y-up scenes).
TriangleMesh rectangle(const glm::dvec3 &centre, const glm::dvec3 &unit_normal, const glm::dvec3 &up,
                       const glm::dvec2 &size);

// Returns six rectangles that face outwards. Each shows the whole texture, upright.
TriangleMesh cuboid(const glm::dvec3 &centre, const glm::dvec3 &up, const glm::dvec3 &size);

} // namespace arhost::scene
