// SPDX-License-Identifier: Apache-2.0
#include "scene/tangents.hpp"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

namespace arhost::scene {
namespace {

// Two triangles of a square in the xy plane that faces +z. `texcoords`: of its corners, counter-clockwise from (0,
// 0).
TriangleMesh square_with(const std::vector<glm::vec2> &texcoords) {
    TriangleMesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    mesh.normals.assign(4, {0, 0, 1});
    mesh.texcoords = texcoords;
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    return mesh;
}

} // namespace

TEST(Tangents, PointInTheDirectionInWhichUIncreases) {
    TriangleMesh mesh = square_with({{0, 1}, {1, 1}, {1, 0}, {0, 0}});
    add_tangents(mesh, 0);
    EXPECT_EQ(mesh.tangents, std::vector<glm::vec4>(4, {1, 0, 0, 1}));
    mesh = square_with({{1, 1}, {0, 1}, {0, 0}, {1, 0}});
    add_tangents(mesh, 0);
    EXPECT_EQ(mesh.tangents, std::vector<glm::vec4>(4, {-1, 0, 0, -1})) << "mirrored";
}

TEST(Tangents, UseTheGivenSetOfTexcoords) {
    TriangleMesh mesh = square_with({{0, 0}, {0, 0}, {0, 0}, {0, 0}, /* set 1 */ {0, 0}, {0, 1}, {1, 1}, {1, 0}});
    add_tangents(mesh, 1);
    EXPECT_EQ(mesh.tangents.front(), glm::vec4(0, 1, 0, 1)) << "not mirrored: u is up, v to the right";
}

TEST(Tangents, SplitVerticesWhereMirroredTrianglesMeet) {
    // u is mirrored at x = 1.
    TriangleMesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {2, 0, 0}};
    mesh.normals.assign(4, {0, 0, 1});
    mesh.texcoords = {{0, 1}, {1, 1}, {1, 0}, {0, 1}};
    mesh.colours = {{1, 0, 0, 0}, {2, 0, 0, 0}, {3, 0, 0, 0}, {4, 0, 0, 0}};
    mesh.triangles = {{0, 1, 2}, {1, 3, 2}};
    add_tangents(mesh, 0);
    ASSERT_EQ(mesh.positions.size(), 6u);
    for (const std::size_t triangle : {0u, 1u})
        for (int corner = 0; corner < 3; ++corner) {
            const std::uint32_t vertex = mesh.triangles[triangle][corner];
            EXPECT_EQ(mesh.tangents[vertex], (triangle == 0 ? glm::vec4(1, 0, 0, 1) : glm::vec4(-1, 0, 0, -1)));
        }
    EXPECT_EQ(mesh.colours[mesh.triangles[1].y].x, 4);
    EXPECT_EQ(mesh.texcoords.size(), 6u);
}

TEST(Tangents, OfVerticesAtTheSamePlaceAreEqual) {
    // A roof along y, whose triangles have vertices of their own with common normals.
    TriangleMesh mesh;
    mesh.positions = {{-1, 0, 0}, {0, 0, 1}, {0, 1, 1}, {0, 0, 1}, {1, 0, 0}, {0, 1, 1}};
    const glm::vec3 left = glm::normalize(glm::vec3(-1, 0, 1)), right = glm::normalize(glm::vec3(1, 0, 1));
    mesh.normals = {left, {0, 0, 1}, {0, 0, 1}, {0, 0, 1}, right, {0, 0, 1}};
    mesh.texcoords = {{0, 1}, {0.5f, 1}, {0.5f, 0}, {0.5f, 1}, {1, 1}, {0.5f, 0}};
    mesh.triangles = {{0, 1, 2}, {3, 4, 5}};
    add_tangents(mesh, 0);
    EXPECT_EQ(mesh.tangents[mesh.triangles[0].y], mesh.tangents[mesh.triangles[1].x]);
    EXPECT_NEAR(glm::distance(mesh.tangents[mesh.triangles[0].y], glm::vec4(1, 0, 0, 1)), 0, 1e-6);
}

TEST(Tangents, AreZeroWithoutADirection) {
    TriangleMesh mesh = square_with(std::vector<glm::vec2>(4, {0.5f, 0.5f}));
    add_tangents(mesh, 0);
    EXPECT_EQ(mesh.tangents, std::vector<glm::vec4>(4, glm::vec4(0)));
    TriangleMesh flat = square_with({{0, 1}, {1, 1}, {1, 0}, {0, 0}});
    flat.normals.clear();
    add_tangents(flat, 0);
    EXPECT_TRUE(flat.tangents.empty());
}

} // namespace arhost::scene
