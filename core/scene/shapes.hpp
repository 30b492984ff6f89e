// SPDX-License-Identifier: Apache-2.0
//
// Transforms that are baked into vertices, and the built-in shapes of scene files. Private to core/scene.
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

    // The scale factor, or nothing if it depends on the direction.
    std::optional<double> uniform_scale() const;

    // Normals by the inverse transpose. A mirroring transform flips the winding, so that front faces stay front
    // faces.
    void apply(TriangleMesh &mesh) const;

private:
    Transform(const glm::dmat3 &linear, const glm::dvec3 &offset) : linear_(linear), offset_(offset) {}
    glm::dmat3 linear_{1};
    glm::dvec3 offset_{0};
};

// 2 triangles, counter-clockwise seen from the side `normal` points to. The first side is horizontal, the second
// as close to `up` as possible. In a horizontal rectangle, they run along x and along y (z-up) or −z (y-up).
TriangleMesh rectangle(const glm::dvec3 &centre, const glm::dvec3 &unit_normal, const glm::dvec3 &up,
                       const glm::dvec2 &size);

// Six rectangles that face outwards, each with the whole texture, upright.
TriangleMesh cuboid(const glm::dvec3 &centre, const glm::dvec3 &up, const glm::dvec3 &size);

} // namespace arhost::scene
