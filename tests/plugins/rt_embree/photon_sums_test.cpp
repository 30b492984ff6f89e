// SPDX-License-Identifier: Apache-2.0
#include "photon_sums.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <random>
#include <span>
#include <vector>

namespace rt_embree {
namespace {

using arhost::raytracer_common::Photon, arhost::raytracer_common::PhotonMap;

struct Set {
    std::vector<Photon> photons;
    std::vector<std::int8_t> faces;
};

// Most photons are in a small part of a box, and every eighth arrived nowhere.
Set photons_in_a_box() {
    std::mt19937 random(1);
    const auto up_to = [&](float limit) { return limit * static_cast<float>(random()) * 0x1p-32f; };
    Set set;
    for (int i = 0; i < 4000; ++i) {
        const float side = i % 4 == 0 ? 100 : 8;
        set.photons.push_back({{up_to(side), up_to(side), up_to(side)},
                               {up_to(1), up_to(1), up_to(1)},
                               {i % 8 == 1 ? -1 : up_to(1), up_to(1), up_to(1)}});
        set.faces.push_back(static_cast<std::int8_t>(random() % (virtual_face + 1)));
    }
    return set;
}

using Cell = std::array<std::int32_t, 5>; // x, y, z, face, level
struct Sum {
    double power[3]{}, direction[3]{};
    std::int32_t count = 0;
};

// The sums of all cells. A photon is also in the next level if its cell or a neighbour has more than `least_limit`
// photons of its face.
std::map<Cell, Sum> summed(const Set &set, const PhotonMap &map) {
    std::map<Cell, Sum> sums;
    std::vector<std::size_t> numbers(set.photons.size());
    for (std::size_t i = 0; i < numbers.size(); ++i)
        numbers[i] = i;
    std::erase_if(numbers, [&](std::size_t i) { return set.photons[i].power[0] < 0; });
    for (std::int32_t level = 0; level < static_cast<std::int32_t>(map.levels().size()); ++level) {
        const auto cell_of = [&](std::size_t i) {
            Cell cell{0, 0, 0, set.faces[i], level};
            for (std::size_t axis = 0; axis < 3; ++axis)
                cell[axis] = static_cast<std::int32_t>((set.photons[i].position[axis] - map.low()[axis]) *
                                                       (0.5f / map.levels()[static_cast<std::size_t>(level)].radius));
            return cell;
        };
        for (const std::size_t i : numbers) {
            const Photon &photon = set.photons[i];
            Sum &sum = sums[cell_of(i)];
            ++sum.count;
            const double weight = double{photon.power[0]} + photon.power[1] + photon.power[2];
            for (std::size_t k = 0; k < 3; ++k) {
                sum.power[k] += photon.power[k];
                sum.direction[k] += photon.direction[k] * weight;
            }
        }
        std::erase_if(numbers, [&](std::size_t i) {
            const Cell cell = cell_of(i);
            for (std::int32_t neighbour = 0; neighbour < 27; ++neighbour) {
                const auto at = sums.find({cell[0] + neighbour % 3 - 1, cell[1] + neighbour / 3 % 3 - 1,
                                           cell[2] + neighbour / 9 - 1, cell[3], level});
                if (at != sums.end() && at->second.count > PhotonCell::least_limit)
                    return false;
            }
            return true;
        });
    }
    return sums;
}

// Searches as the comment of Photons::cells says. Null: there is no such cell.
const PhotonCell *find(const Photons &photons, std::uint32_t key) {
    const auto *cells = reinterpret_cast<const PhotonCell *>(photons.cells);
    const auto mask = static_cast<std::uint32_t>(photons.cell_mask);
    for (std::uint32_t slot = PhotonCell::hash(key) & mask; cells[slot].count > 0; slot = (slot + 1) & mask)
        if (cells[slot].key == key)
            return cells + slot;
    return nullptr;
}

TEST(PhotonSums, HaveTheCountThePowerAndTheDirectionOfEachCell) {
    const Set set = photons_in_a_box();
    PhotonMap map;
    map.build(set.photons, {.sorts = false, .shift = {0.3f, 0.6f, 0.9f}});
    const PhotonSums sums(map, set.photons, set.faces);
    const Photons photons = sums.view();
    const std::map<Cell, Sum> expected = summed(set, map);
    for (const auto &[cell, sum] : expected) {
        const PhotonCell *found = find(photons, PhotonCell::key_of(cell[0], cell[1], cell[2], cell[3], cell[4]));
        ASSERT_NE(found, nullptr);
        ASSERT_EQ(found->count, sum.count);
        for (std::size_t k = 0; k < 3; ++k) {
            ASSERT_NEAR(found->power[k], sum.power[k], 1e-4 * sum.count);
            ASSERT_NEAR(found->direction[k], sum.direction[k], 1e-4 * sum.count);
        }
    }
    const std::span cells(reinterpret_cast<const PhotonCell *>(photons.cells),
                          static_cast<std::size_t>(photons.cell_mask) + 1);
    EXPECT_EQ(std::ranges::count_if(cells, [](const PhotonCell &cell) { return cell.count > 0; }),
              static_cast<std::ptrdiff_t>(expected.size()));
    EXPECT_TRUE(std::ranges::any_of(expected, [](const auto &each) { return each.first[4] == 3; }))
        << "no cell is dense";
    EXPECT_GE(cells.size(), 2 * expected.size()) << "long searches";
    EXPECT_GT(cells.size(), 1024u) << "the table has not grown";
}

TEST(PhotonSums, AreEmptyIfNoPhotonArrives) {
    const Set set{{{{1, 2, 3}, {0, 0, -1}, {-1, 0, 0}}}, {0}};
    PhotonMap map;
    map.build(set.photons);
    const PhotonSums sums(map, set.photons, set.faces);
    EXPECT_EQ(sums.view().level_count, 0);
}

} // namespace
} // namespace rt_embree
