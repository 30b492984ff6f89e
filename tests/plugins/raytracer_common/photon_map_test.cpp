// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/photon_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace arhost::raytracer_common {
namespace {

// Photons on a square with a side of 100 mm, and one far away.
std::vector<Photon> photons_on_a_table() {
    std::mt19937 random(1);
    std::uniform_real_distribution<float> at(0, 100);
    std::vector<Photon> photons;
    for (int i = 0; i < 2000; ++i)
        photons.push_back({{at(random), at(random), 0}, {0, 0, -1}, {1, 1, 1}});
    photons.push_back({{900, 900, 0}, {0, 0, -1}, {1, 1, 1}});
    photons.push_back({{50, 50, 0}, {0, 0, -1}, {-1, 0, 0}}); // arrived nowhere
    return photons;
}

bool is_near(const PhotonMap &map, float x, float y, float z, std::uint32_t level = 0) {
    const float position[] = {x, y, z}, side = 2 * map.levels()[0].radius * static_cast<float>(1u << level);
    std::int32_t cell[3];
    for (std::size_t i = 0; i < 3; ++i)
        cell[i] = static_cast<std::int32_t>(std::floor((position[i] - map.low()[i]) / side));
    const std::uint32_t bit =
        PhotonGrid::hash(cell[0], cell[1], cell[2]) % PhotonMap::near_bits + level * PhotonMap::near_bits;
    return (map.near()[bit / 32] >> (bit % 32) & 1) != 0;
}

TEST(PhotonMap, MarksTheCellsOfPhotonsAndTheirNeighbours) {
    PhotonMap map;
    map.build(photons_on_a_table());
    const float side = 2 * map.levels()[0].radius;
    for (const Photon &photon : map.photons())
        for (const float x : {-0.9f, 0.0f, 0.9f})
            for (const float y : {-0.9f, 0.0f, 0.9f})
                ASSERT_TRUE(is_near(map, photon.position[0] + x * side, photon.position[1] + y * side, 0));
    int marked = 0; // by chance
    for (int i = 0; i < 100; ++i)
        marked += is_near(map, 300 + 5 * static_cast<float>(i), 300, 100);
    EXPECT_LT(marked, 10);
}

TEST(PhotonMap, MarksLargerCells) {
    PhotonMap map;
    map.build(photons_on_a_table(), {.sorts = false, .shift = {0.3f, 0.6f, 0.9f}});
    for (std::uint32_t level = 1; level < PhotonMap::near_levels; ++level) {
        const float reach = 1.8f * map.levels()[0].radius * static_cast<float>(1u << level);
        for (const float x : {100.0f, 100 + reach})
            for (const float y : {0.0f, -reach})
                EXPECT_TRUE(is_near(map, x, y, 0, level)) << level;
        EXPECT_FALSE(is_near(map, 500, 300, 500, level)) << level;
    }
}

TEST(PhotonMap, DoesNotMarkCellsWithNegligibleLight) {
    PhotonMap map;
    map.build(photons_on_a_table(), {.negligible = 0.1f}); // irradiance / π; on the table, it is 0.2
    EXPECT_TRUE(is_near(map, 50, 50, 0));
    EXPECT_FALSE(is_near(map, 900, 900, 0));
}

TEST(PhotonMap, KeepsPhotonsThatArrived) {
    PhotonMap map;
    map.build(photons_on_a_table());
    EXPECT_EQ(map.photons().size(), 2001u);
    for (const PhotonGrid &level : map.levels())
        EXPECT_EQ(level.numbers.size(), 2001u);
    map.build({});
    EXPECT_TRUE(map.levels().empty());
}

} // namespace
} // namespace arhost::raytracer_common
