// SPDX-License-Identifier: Apache-2.0
#include "photon_sums.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>

namespace rt_embree {

using arhost::raytracer_common::Photon, arhost::raytracer_common::PhotonMap;

void PhotonSums::build(const PhotonMap &map, std::span<const Photon> photons, std::span<const std::int8_t> faces,
                       Photons &to) {
    const std::size_t size = std::bit_ceil(2 * map.photons().size() + 1);
    cells_.assign(size * map.levels().size(), PhotonCell{});
    for (std::size_t level = 0; level < map.levels().size(); ++level) {
        PhotonCell *cells = cells_.data() + size * level;
        const float inverse_side = 0.5f / map.levels()[level].radius;
        for (std::size_t i = 0; i < photons.size(); ++i) {
            const Photon &photon = photons[i];
            if (photon.power[0] < 0) // it arrived nowhere
                continue;
            std::int32_t at[3];
            for (std::size_t axis = 0; axis < 3; ++axis)
                at[axis] = static_cast<std::int32_t>(
                    std::clamp((photon.position[axis] - map.low()[axis]) * inverse_side, 0.0f, 1e9f));
            const std::uint32_t key = PhotonCell::key_of(at[0], at[1], at[2], faces[i]);
            std::size_t slot = arhost::raytracer_common::PhotonGrid::hash(at[0], at[1], at[2]) & (size - 1);
            while (cells[slot].count > 0 && cells[slot].key != key)
                slot = (slot + 1) & (size - 1);
            cells[slot].key = key;
            ++cells[slot].count;
            const float power = photon.power[0] + photon.power[1] + photon.power[2];
            for (std::size_t j = 0; j < 3; ++j) {
                cells[slot].power[j] += photon.power[j];
                cells[slot].direction[j] += photon.direction[j] * power;
            }
        }
    }
    to.cells = reinterpret_cast<const float *>(cells_.data());
    to.cells_per_level = static_cast<std::int32_t>(size);
}

} // namespace rt_embree
