// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh.hpp"

#include "scene/vertices.hpp"

#include <arhost/scene.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

namespace arhost::scene {
namespace {

// Returns, for each vertex, the index of the first vertex at the same position.
std::vector<std::uint32_t> welded(std::span<const glm::vec3> positions) {
    return first_equal_vertices(positions.size(), [&](std::uint32_t vertex) {
        const glm::vec3 &p = positions[vertex];
        return std::array{p.x, p.y, p.z};
    });
}

glm::vec3 unit(const glm::dvec3 &v) {
    return unit_or_0(v);
}

} // namespace

bool is_closed(const TriangleMesh &mesh) {
    const std::vector<std::uint32_t> same = welded(mesh.positions);
    const auto edge = [](std::uint64_t from, std::uint64_t to) { return from << 32 | to; };
    std::vector<std::uint64_t> edges, reversed;
    edges.reserve(3 * mesh.triangles.size());
    double six_volumes = 0;
    for (const glm::uvec3 &t : mesh.triangles) {
        const std::uint32_t a = same[t.x], b = same[t.y], c = same[t.z];
        if (a == b || b == c || c == a)
            continue;
        for (const std::uint64_t e : {edge(a, b), edge(b, c), edge(c, a)})
            edges.push_back(e);
        const glm::dvec3 origin = mesh.positions.front();
        six_volumes +=
            glm::dot(glm::dvec3(mesh.positions[a]) - origin,
                     glm::cross(glm::dvec3(mesh.positions[b]) - origin, glm::dvec3(mesh.positions[c]) - origin));
    }
    reversed.reserve(edges.size());
    for (const std::uint64_t e : edges)
        reversed.push_back(edge(e & ARHOST_NONE, e >> 32));
    std::ranges::sort(edges);
    std::ranges::sort(reversed);
    return edges == reversed && six_volumes > 0;
}

std::vector<glm::vec3> smooth_normals(const TriangleMesh &mesh) {
    const std::vector<std::uint32_t> same = welded(mesh.positions);
    std::vector<glm::dvec3> sums(mesh.positions.size(), glm::dvec3(0));
    for (const glm::uvec3 &t : mesh.triangles) {
        const glm::dvec3 a = mesh.positions[t.x], b = mesh.positions[t.y], c = mesh.positions[t.z];
        const glm::dvec3 twice_area = glm::cross(b - a, c - a);
        for (int corner = 0; corner < 3; ++corner)
            sums[same[t[corner]]] += twice_area;
    }
    std::vector<glm::vec3> normals(mesh.positions.size());
    for (std::size_t i = 0; i < normals.size(); ++i) {
        normals[i] = unit(sums[same[i]]);
        if (normals[i] == glm::vec3(0)) // the vertex has no triangles, or only degenerate ones
            normals[i].z = 1;
    }
    return normals;
}

void weld(TriangleMesh &mesh) {
    std::vector<std::uint32_t> index = welded(mesh.positions);
    std::uint32_t count = 0;
    for (std::uint32_t i = 0; i < index.size(); ++i) {
        if (index[i] != i) {
            index[i] = index[index[i]]; // the first vertex at this position already has its new index
            continue;
        }
        mesh.positions[count] = mesh.positions[i];
        index[i] = count++;
    }
    mesh.positions.resize(count);
    for (glm::uvec3 &t : mesh.triangles)
        t = {index[t.x], index[t.y], index[t.z]};
}

std::vector<TriangleMesh> split(const TriangleMesh &mesh, const std::vector<std::size_t> &parts, std::size_t count) {
    std::vector<TriangleMesh> split(count);
    for (std::size_t i = 0; i < parts.size(); ++i)
        split[parts[i]].triangles.push_back(mesh.triangles[i]);
    const std::size_t sets = mesh.texcoords.size() / mesh.positions.size();
    std::vector<std::uint32_t> index(mesh.positions.size(), ARHOST_NONE);
    std::vector<std::uint32_t> vertices; // of the part
    for (TriangleMesh &part : split) {
        vertices.clear();
        for (glm::uvec3 &t : part.triangles)
            for (int corner = 0; corner < 3; ++corner) {
                const std::uint32_t vertex = t[corner];
                if (index[vertex] == ARHOST_NONE) {
                    index[vertex] = static_cast<std::uint32_t>(vertices.size());
                    vertices.push_back(vertex);
                }
                t[corner] = index[vertex];
            }
        const auto copy = [&](const auto &from, auto &to, std::size_t first) {
            for (const std::uint32_t vertex : vertices)
                to.push_back(from[first + vertex]);
        };
        copy(mesh.positions, part.positions, 0);
        if (!mesh.normals.empty())
            copy(mesh.normals, part.normals, 0);
        for (std::size_t set = 0; set < sets; ++set)
            copy(mesh.texcoords, part.texcoords, set * mesh.positions.size());
        if (!mesh.colours.empty())
            copy(mesh.colours, part.colours, 0);
        for (const std::uint32_t vertex : vertices)
            index[vertex] = ARHOST_NONE;
    }
    return split;
}

void complete_normals(TriangleMesh &mesh, std::optional<bool> smooth) {
    if (smooth == false)
        mesh.normals.clear();
    if (mesh.normals.empty() && smooth != true)
        return;
    bool complete = !mesh.normals.empty();
    for (glm::vec3 &normal : mesh.normals) {
        normal = unit(normal);
        complete &= normal != glm::vec3(0);
    }
    if (complete)
        return;
    std::vector<glm::vec3> computed = smooth_normals(mesh);
    for (std::size_t i = 0; i < mesh.normals.size(); ++i)
        if (mesh.normals[i] != glm::vec3(0))
            computed[i] = mesh.normals[i];
    mesh.normals = std::move(computed);
}

} // namespace arhost::scene
