// SPDX-License-Identifier: Apache-2.0
#include "scene/polygon.hpp"

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace arhost::scene {
namespace {

// Returns the normal by Newell's method (Sutherland et al. 1974), which is robust for collinear and slightly
// non-coplanar corners.
glm::dvec3 newell_normal(std::span<const std::uint32_t> polygon, std::span<const glm::vec3> positions) {
    glm::dvec3 normal(0);
    for (std::size_t i = 0; i < polygon.size(); ++i) {
        const glm::dvec3 a = positions[polygon[i]], b = positions[polygon[(i + 1) % polygon.size()]];
        normal += glm::dvec3((a.y - b.y) * (a.z + b.z), (a.z - b.z) * (a.x + b.x), (a.x - b.x) * (a.y + b.y));
    }
    return normal;
}

// Returns twice the signed area of a triangle; it is positive for counter-clockwise corners.
double signed_area2(const glm::dvec2 &a, const glm::dvec2 &b, const glm::dvec2 &c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// Projects the polygon to 2D by dropping the axis along which its normal is longest. The result is counter-clockwise.
std::vector<glm::dvec2> projected(std::span<const std::uint32_t> polygon, std::span<const glm::vec3> positions) {
    const glm::dvec3 normal = newell_normal(polygon, positions), size = glm::abs(normal);
    const int dropped = size.x > size.y && size.x > size.z ? 0 : size.y > size.z ? 1 : 2;
    int u = (dropped + 1) % 3, v = (dropped + 2) % 3;
    if (normal[dropped] < 0)
        std::swap(u, v);
    std::vector<glm::dvec2> points(polygon.size());
    for (std::size_t i = 0; i < polygon.size(); ++i)
        points[i] = {positions[polygon[i]][u], positions[polygon[i]][v]};
    return points;
}

bool is_convex(const std::vector<glm::dvec2> &points) {
    const std::size_t n = points.size();
    for (std::size_t i = 0; i < n; ++i)
        if (signed_area2(points[i], points[(i + 1) % n], points[(i + 2) % n]) < 0)
            return false;
    return true;
}

void clip_ears(const std::vector<glm::dvec2> &points, std::vector<glm::uvec3> &triangles) {
    std::vector<std::uint32_t> remaining(points.size());
    std::iota(remaining.begin(), remaining.end(), 0u);
    std::size_t at = 0, failed = 0;
    while (remaining.size() > 3) {
        const std::size_t n = remaining.size();
        const std::uint32_t a = remaining[(at + n - 1) % n], b = remaining[at % n], c = remaining[(at + 1) % n];
        const double area = signed_area2(points[a], points[b], points[c]);
        const bool ear = area >= 0 && std::none_of(remaining.begin(), remaining.end(), [&](std::uint32_t i) {
                             const glm::dvec2 &p = points[i];
                             return p != points[a] && p != points[b] && p != points[c] &&
                                    signed_area2(points[a], points[b], p) >= 0 &&
                                    signed_area2(points[b], points[c], p) >= 0 &&
                                    signed_area2(points[c], points[a], p) >= 0;
                         });
        // A self-intersecting polygon may have no ear left; in that case, clip any corner.
        if (ear || failed == n) {
            triangles.emplace_back(a, b, c);
            remaining.erase(remaining.begin() + static_cast<std::ptrdiff_t>(at % n));
            at = at % n == n - 1 ? 0 : at % n;
            failed = 0;
        } else {
            at = (at + 1) % n;
            ++failed;
        }
    }
    triangles.emplace_back(remaining[0], remaining[1], remaining[2]);
}

} // namespace

std::span<const glm::uvec3> triangulate(std::span<const std::uint32_t> polygon, std::span<const glm::vec3> positions,
                                        std::vector<glm::uvec3> &triangles) {
    triangles.clear();
    if (polygon.size() > 3) {
        const std::vector<glm::dvec2> points = projected(polygon, positions);
        if (!is_convex(points)) {
            if (polygon.size() <= concave_corner_limit)
                clip_ears(points, triangles);
            return triangles;
        }
    }
    for (std::uint32_t i = 2; i < polygon.size(); ++i)
        triangles.emplace_back(0, i - 1, i);
    return triangles;
}

} // namespace arhost::scene
