// SPDX-License-Identifier: Apache-2.0
#include "photon_sums.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace rt_embree {

using arhost::raytracer_common::Photon, arhost::raytracer_common::PhotonMap;

PhotonSums::PhotonSums(const PhotonMap &map, std::span<const Photon> photons, std::span<const std::int8_t> faces)
    : cells_(1024), near_(map.near().begin(), map.near().end()), low_(map.low()) {
    std::vector<std::size_t> numbers; // of the photons that this level has
    for (std::size_t i = 0; i < photons.size(); ++i)
        if (photons[i].power[0] >= 0) // it arrived somewhere
            numbers.push_back(i);
    for (const arhost::raytracer_common::PhotonGrid &grid : map.levels()) {
        const auto level = static_cast<std::int32_t>(radii_.size());
        radii_.push_back(grid.radius);
        const auto key_of = [&](std::size_t i) {
            std::int32_t at[3];
            for (std::size_t axis = 0; axis < 3; ++axis)
                at[axis] = static_cast<std::int32_t>(
                    std::clamp((photons[i].position[axis] - low_[axis]) * (0.5f / grid.radius), 0.0f, 1e9f));
            return PhotonCell::key_of(at[0], at[1], at[2], faces[i], level);
        };
        for (const std::size_t i : numbers)
            add(photons[i], key_of(i));
        // Samples look up a point near the surface, on each level another one. If the first is in a dense cell, the
        // next may be in a neighbour of that cell.
        std::vector<bool> is_done(cells_.size()), is_divided(cells_.size());
        for (const std::size_t i : numbers) {
            const std::uint32_t key = key_of(i);
            const std::size_t slot = slot_of(key);
            if (cells_[slot].count <= PhotonCell::least_limit || is_done[slot])
                continue;
            is_done[slot] = true;
            for (std::int32_t neighbour = 0; neighbour < 27; ++neighbour)
                is_divided[slot_of(key + PhotonCell::key_of(neighbour % 3 - 1, neighbour / 3 % 3 - 1,
                                                            neighbour / 9 - 1, 0, 0))] = true;
        }
        std::erase_if(numbers, [&](std::size_t i) { return !is_divided[slot_of(key_of(i))]; });
    }
}

// Returns the index of the cell of a key, or of an empty cell if there is none.
std::size_t PhotonSums::slot_of(std::uint32_t key) const {
    std::size_t slot = PhotonCell::hash(key) & (cells_.size() - 1);
    while (cells_[slot].count > 0 && cells_[slot].key != key)
        slot = (slot + 1) & (cells_.size() - 1);
    return slot;
}

void PhotonSums::add(const Photon &photon, std::uint32_t key) {
    PhotonCell &cell = cells_[slot_of(key)];
    const float power = photon.power[0] + photon.power[1] + photon.power[2];
    for (std::size_t i = 0; i < 3; ++i) {
        cell.power[i] += photon.power[i];
        cell.direction[i] += photon.direction[i] * power;
    }
    cell.key = key;
    if (++cell.count == 1 && 2 * ++used_ > cells_.size()) {
        const std::vector<PhotonCell> all = std::exchange(cells_, std::vector<PhotonCell>(2 * cells_.size()));
        for (const PhotonCell &each : all)
            if (each.count > 0)
                cells_[slot_of(each.key)] = each;
    }
}

Photons PhotonSums::view() const {
    Photons photons{};
    if (used_ == 0)
        return photons;
    photons.near = near_.data();
    std::ranges::copy(low_, photons.low);
    for (const float radius : radii_)
        photons.levels[photons.level_count++].radius = radius;
    photons.cells = reinterpret_cast<const float *>(cells_.data());
    photons.cell_mask = static_cast<std::int32_t>(cells_.size() - 1);
    return photons;
}

} // namespace rt_embree
