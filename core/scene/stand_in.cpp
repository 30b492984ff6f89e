// SPDX-License-Identifier: Apache-2.0
#include "scene/stand_in.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace arhost::scene {
namespace {

constexpr double two_pi = 2 * std::numbers::pi;

// Returns a point of a tube along the (2,3) torus knot; the torus has the radii 2 and 1 and the axis z. `along` (0 to
// 1) is the position along the knot, `around` (0 to 1) the position around the tube. Seen from outside, the direction
// of `around` is 90° counter-clockwise from that of `along`.
glm::dvec3 on_knot(double along, double around) {
    const double t = two_pi * along, angle = two_pi * around;
    const auto centre = [](double t) {
        const double r = 2 + std::cos(3 * t);
        return glm::dvec3(r * std::cos(2 * t), r * std::sin(2 * t), std::sin(3 * t));
    };
    constexpr double h = 1e-4;
    const glm::dvec3 tangent = glm::normalize(centre(t + h) - centre(t - h));
    const glm::dvec3 outward(std::cos(3 * t) * std::cos(2 * t), std::cos(3 * t) * std::sin(2 * t), std::sin(3 * t));
    const glm::dvec3 sideways = glm::cross(outward, tangent);
    const double radius = 0.5 + 0.06 * std::sin(12 * t) * std::cos(3 * angle) + 0.05 * std::sin(3 * t);
    return centre(t) + radius * (std::cos(angle) * outward + std::sin(angle) * sideways);
}

void fit(TriangleMesh &mesh, const glm::dvec3 &size) {
    glm::dvec3 low = mesh.positions.front(), high = low;
    for (const glm::vec3 &p : mesh.positions) {
        low = glm::min(low, glm::dvec3(p));
        high = glm::max(high, glm::dvec3(p));
    }
    const glm::dvec3 foot((low.x + high.x) / 2, low.y, (low.z + high.z) / 2);
    for (glm::vec3 &p : mesh.positions)
        p = (glm::dvec3(p) - foot) * size / (high - low);
}

} // namespace

TriangleMesh stand_in(std::uint32_t faces, const glm::dvec3 &size) {
    // The tube consists of roughly square quads of two triangles each. To reach the exact count, some quads are split
    // into four triangles, and if the count is odd, one triangle is split into two.
    const std::uint32_t pairs = faces / 2;
    const auto around = std::clamp(static_cast<std::uint32_t>(std::sqrt(pairs / 9.0)), 3u, pairs / 3);
    const std::uint32_t along = pairs / around;
    const std::uint32_t split_quads = pairs - along * around; // fewer than `around`

    TriangleMesh mesh;
    mesh.positions.reserve(std::size_t(along) * around + split_quads + 1);
    mesh.triangles.reserve(faces);
    for (std::uint32_t i = 0; i < along; ++i)
        for (std::uint32_t j = 0; j < around; ++j)
            mesh.positions.push_back(on_knot(static_cast<double>(i) / along, static_cast<double>(j) / around));
    for (std::uint32_t i = 0; i < along; ++i)
        for (std::uint32_t j = 0; j < around; ++j) {
            const std::uint32_t next_i = (i + 1) % along, next_j = (j + 1) % around;
            const std::uint32_t a = i * around + j, b = next_i * around + j, c = next_i * around + next_j,
                                d = i * around + next_j;
            if (i == 0 && j < split_quads) {
                const auto middle = static_cast<std::uint32_t>(mesh.positions.size());
                mesh.positions.push_back(on_knot(0.5 / along, (j + 0.5) / around));
                for (const glm::uvec2 side : {glm::uvec2(a, b), {b, c}, {c, d}, {d, a}})
                    mesh.triangles.push_back({side.x, side.y, middle});
            } else {
                mesh.triangles.push_back({a, b, c});
                mesh.triangles.push_back({a, c, d});
            }
        }
    fit(mesh, size);
    if (faces % 2) {
        const glm::uvec3 t = mesh.triangles.back();
        const auto middle = static_cast<std::uint32_t>(mesh.positions.size());
        mesh.positions.push_back((mesh.positions[t.y] + mesh.positions[t.z]) / 2.0f);
        mesh.triangles.back() = {t.x, t.y, middle};
        mesh.triangles.push_back({t.x, middle, t.z});
    }
    return mesh;
}

} // namespace arhost::scene
