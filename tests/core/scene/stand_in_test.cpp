// SPDX-License-Identifier: Apache-2.0
#include "scene/stand_in.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <map>
#include <utility>

using namespace arhost::scene;

namespace {

// Returns six times the enclosed volume. It is positive if the triangles are counter-clockwise seen from outside.
double signed_volume(const TriangleMesh &mesh) {
    double sum = 0;
    for (const glm::uvec3 &t : mesh.triangles)
        sum += glm::dot(glm::dvec3(mesh.positions[t.x]),
                        glm::cross(glm::dvec3(mesh.positions[t.y]), glm::dvec3(mesh.positions[t.z])));
    return sum;
}

// Returns the number of directed edges that do not have exactly one opposite edge. It is 0 for a closed mesh.
int open_edges(const TriangleMesh &mesh) {
    std::map<std::pair<unsigned, unsigned>, int> edges;
    for (const glm::uvec3 &t : mesh.triangles)
        for (const auto &[a, b] : {std::pair(t.x, t.y), {t.y, t.z}, {t.z, t.x}})
            edges[{a, b}] += 1;
    int open = 0;
    for (const auto &[edge, count] : edges) {
        const auto back = edges.find({edge.second, edge.first});
        open += count != 1 || back == edges.end() || back->second != 1;
    }
    return open;
}

} // namespace

// The last five triangle counts are those of table 1 of the dissertation.
class StandIns : public testing::TestWithParam<unsigned> {};

TEST_P(StandIns, HaveTheExactTriangleCountAndFillTheirBox) {
    const glm::dvec3 size(1.42, 1, 0.63);
    const TriangleMesh mesh = stand_in(GetParam(), size);
    EXPECT_EQ(mesh.triangles.size(), GetParam());
    glm::vec3 low = mesh.positions[0], high = low;
    for (const glm::vec3 &p : mesh.positions) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    for (int i = 0; i < 3; ++i) {
        EXPECT_NEAR(low[i], i == 1 ? 0 : -size[i] / 2, 1e-6);
        EXPECT_NEAR(high[i], i == 1 ? size[i] : size[i] / 2, 1e-6);
    }
    EXPECT_GT(signed_volume(mesh), 0.1);
}

INSTANTIATE_TEST_SUITE_P(Counts, StandIns,
                         testing::Values(100, 101, 999, 4968, 126'048, 448'880, 871'306, 1'087'451));

TEST(StandInMeshes, AreClosedForEvenCounts) {
    for (const unsigned faces : {100, 998, 4968})
        EXPECT_EQ(open_edges(stand_in(faces, glm::dvec3(1))), 0) << faces;
    // If the count is odd, the open edges are the split edge and its two halves.
    EXPECT_EQ(open_edges(stand_in(999, glm::dvec3(1))), 3);
}
