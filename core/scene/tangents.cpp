// SPDX-License-Identifier: Apache-2.0
#include "scene/tangents.hpp"

#include "scene/vertices.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace arhost::scene {
namespace {

// The direction in which u increases on a triangle, a unit vector or 0, and whether u and v are mirrored.
struct Direction {
    glm::dvec3 along_u{0};
    bool is_mirrored = false;
};

Direction direction_of(const TriangleMesh &mesh, const glm::vec2 *texcoords, const glm::uvec3 &triangle) {
    const auto position = [&](int corner) { return glm::dvec3(mesh.positions[triangle[corner]]); };
    const auto texcoord = [&](int corner) { return glm::dvec2(texcoords[triangle[corner]]); };
    const glm::dvec3 edge_1 = position(1) - position(0), edge_2 = position(2) - position(0);
    const glm::dvec2 change_1 = texcoord(1) - texcoord(0), change_2 = texcoord(2) - texcoord(0);
    // v increases downwards in images, so the area is negative for an image that is not mirrored.
    const double area = change_1.x * change_2.y - change_1.y * change_2.x;
    return {unit_or_0((edge_1 * change_2.y - edge_2 * change_1.y) * (area < 0 ? -1.0 : 1.0)), area > 0};
}

// Makes vertex i a copy of the old vertex sources[i].
void gather(TriangleMesh &mesh, const std::vector<std::uint32_t> &sources) {
    const std::size_t before = mesh.positions.size();
    const auto apply = [&]<class T>(std::vector<T> &values) {
        std::vector<T> gathered;
        gathered.reserve(values.size() / before * sources.size());
        for (std::size_t first = 0; first + before <= values.size(); first += before) // a set of texture coordinates
            for (const std::uint32_t source : sources)
                gathered.push_back(values[first + source]);
        values = std::move(gathered);
    };
    apply(mesh.texcoords);
    apply(mesh.normals);
    apply(mesh.colours);
    apply(mesh.positions);
}

} // namespace

void add_tangents(TriangleMesh &mesh, std::size_t texcoord_set) {
    if (!mesh.tangents.empty() || mesh.normals.empty())
        return;
    const std::size_t count = mesh.positions.size();
    const glm::vec2 *texcoords = mesh.texcoords.data() + texcoord_set * count;
    const std::vector<std::uint32_t> first = first_equal_vertices(count, [&](std::uint32_t vertex) {
        const glm::vec3 &p = mesh.positions[vertex], &n = mesh.normals[vertex];
        const glm::vec2 &t = texcoords[vertex];
        return std::array{p.x, p.y, p.z, n.x, n.y, n.z, t.x, t.y};
    });

    // The sums for triangles that are not mirrored, and for those that are.
    std::array<std::vector<glm::dvec3>, 2> sums{std::vector<glm::dvec3>(count), std::vector<glm::dvec3>(count)};
    std::vector<bool> mirrored(mesh.triangles.size());
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        const glm::uvec3 &triangle = mesh.triangles[t];
        const Direction direction = direction_of(mesh, texcoords, triangle);
        mirrored[t] = direction.is_mirrored;
        for (int corner = 0; corner < 3; ++corner) {
            const std::uint32_t vertex = triangle[corner];
            const glm::dvec3 normal(mesh.normals[vertex]);
            const auto in_plane = [&](const glm::dvec3 &a) { return unit_or_0(a - normal * glm::dot(normal, a)); };
            const auto to = [&](int step) {
                return in_plane(glm::dvec3(mesh.positions[triangle[(corner + step) % 3]]) -
                                glm::dvec3(mesh.positions[vertex]));
            };
            const double angle = std::acos(std::clamp(glm::dot(to(1), to(2)), -1.0, 1.0));
            sums[direction.is_mirrored][first[vertex]] += in_plane(direction.along_u) * angle;
        }
    }

    std::vector<std::uint32_t> sources; // the old vertex of each new one
    std::array<std::vector<std::uint32_t>, 2> numbers;
    for (auto &of_side : numbers)
        of_side.assign(count, static_cast<std::uint32_t>(-1));
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
        for (int corner = 0; corner < 3; ++corner) {
            std::uint32_t &vertex = mesh.triangles[t][corner], &number = numbers[mirrored[t]][vertex];
            if (number == static_cast<std::uint32_t>(-1)) {
                number = static_cast<std::uint32_t>(sources.size());
                sources.push_back(vertex);
                const glm::vec3 tangent(unit_or_0(sums[mirrored[t]][first[vertex]]));
                mesh.tangents.push_back(tangent == glm::vec3(0) ? glm::vec4(0)
                                                                : glm::vec4(tangent, mirrored[t] ? -1 : 1));
            }
            vertex = number;
        }
    gather(mesh, sources);
}

} // namespace arhost::scene
