// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh.hpp"

#include "scene/mesh_text.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <cctype>

namespace arhost::scene {
namespace {

enum class Kind { Obj, Ply };

// "dragon.PLY.gz" → ".ply"
std::string extension_of(std::filesystem::path file) {
    const auto lower = [](std::string text) {
        std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
        return text;
    };
    if (lower(file.extension().string()) == ".gz")
        file = file.stem();
    return lower(file.extension().string());
}

Kind kind_of(const std::filesystem::path &file) {
    const std::string extension = extension_of(file);
    if (extension == ".obj")
        return Kind::Obj;
    if (extension == ".ply")
        return Kind::Ply;
    throw MeshError(file.string() + ": " +
                    (extension.empty() ? "a mesh file without extension" : "mesh files '*" + extension + "'") +
                    " can't be loaded; convert it to .obj or .ply (each may be packed as .gz)");
}

void refuse_foreign_content(const MeshText &text, Kind kind) {
    const std::string_view content = text.view();
    if (content.empty())
        text.fail("is empty");
    if (content.starts_with("\xfe\xff") || content.starts_with("\xff\xfe"))
        text.fail("is text in UTF-16; save it as UTF-8 or ASCII");
    const bool is_ply = content.starts_with("ply\n") || content.starts_with("ply\r");
    if (kind == Kind::Ply && !is_ply)
        text.fail_line(text.begin(), "a PLY file begins with a line 'ply', this one does not");
    if (kind == Kind::Obj && is_ply)
        text.fail("is a PLY file by its content; name it .ply");
}

// Equal positions get equal numbers, by a hash table with open addressing.
std::vector<std::uint32_t> welded(std::span<const glm::vec3> positions) {
    std::vector<std::uint32_t> table(std::bit_ceil(positions.size() * 2), ARHOST_NONE), same(positions.size());
    for (std::uint32_t i = 0; i < positions.size(); ++i) {
        const glm::vec3 p = positions[i] + 0.f; // −0 becomes 0
        std::uint64_t hash = std::bit_cast<std::uint32_t>(p.x) * 0x9e3779b97f4a7c15u ^
                             std::bit_cast<std::uint32_t>(p.y) * 0xc2b2ae3d27d4eb4fu ^
                             std::bit_cast<std::uint32_t>(p.z) * 0x165667b19e3779f9u;
        hash ^= hash >> 32;
        std::size_t slot = hash & (table.size() - 1);
        while (table[slot] != ARHOST_NONE && positions[table[slot]] != positions[i])
            slot = (slot + 1) & (table.size() - 1);
        if (table[slot] == ARHOST_NONE)
            table[slot] = i;
        same[i] = table[slot];
    }
    return same;
}

// In double precision: the squares of small meshes' lengths would vanish in floats.
glm::vec3 unit(const glm::dvec3 &v) {
    const double length = glm::length(v);
    return length > 0 && std::isfinite(length) ? glm::vec3(v / length) : glm::vec3(0);
}

} // namespace

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
        if (normals[i] == glm::vec3(0)) // of no triangle, or of one without area
            normals[i].z = 1;
    }
    return normals;
}

void settle_normals(TriangleMesh &mesh, std::optional<bool> smooth) {
    if (smooth == false)
        mesh.normals.clear();
    if (mesh.normals.empty() && smooth != true)
        return;
    bool all_there = !mesh.normals.empty();
    for (glm::vec3 &normal : mesh.normals) {
        normal = unit(normal);
        all_there &= normal != glm::vec3(0);
    }
    if (all_there)
        return;
    // None, or some of length 0.
    std::vector<glm::vec3> computed = smooth_normals(mesh);
    for (std::size_t i = 0; i < mesh.normals.size(); ++i)
        if (mesh.normals[i] != glm::vec3(0))
            computed[i] = mesh.normals[i];
    mesh.normals = std::move(computed);
}

TriangleMesh load_mesh(const std::filesystem::path &file, const MeshOptions &options,
                       const LoadCallbacks &callbacks) {
    const Kind kind = kind_of(file);
    const Watch watch(callbacks, file.filename().string());
    TriangleMesh mesh;
    {
        MeshText text = MeshText::read(file, options.byte_limit, watch);
        refuse_foreign_content(text, kind);
        mesh = kind == Kind::Obj ? parse_obj(text, watch) : parse_ply(text, watch);
    }
    for (glm::vec2 &texcoord : mesh.texcoords) // these files count from the texture's bottom
        texcoord.y = 1 - texcoord.y;
    settle_normals(mesh, options.smooth);
    return mesh;
}

} // namespace arhost::scene
