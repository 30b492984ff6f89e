// SPDX-License-Identifier: Apache-2.0
//
// The power of a set of photons, summed over the cells of grids. Denoising makes up for the coarse cells; looking up
// a sum takes much less time than a density estimate from single photons.
#pragma once

#include "kernel.hpp"
#include "raytracer_common/photon_map.hpp"

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace rt_embree {

class PhotonSums {
public:
    // `map`: of the same photons. `faces`: see TracePhotons.
    PhotonSums(const arhost::raytracer_common::PhotonMap &map,
               std::span<const arhost::raytracer_common::Photon> photons, std::span<const std::int8_t> faces);

    // Returns the input of the kernel, valid while this exists.
    Photons view() const;

private:
    std::size_t slot_of(std::uint32_t key) const;
    void add(const arhost::raytracer_common::Photon &photon, std::uint32_t key);

    std::vector<PhotonCell> cells_; // as in Photons
    std::size_t used_ = 0;          // number of cells with photons
    std::vector<std::int32_t> near_;
    std::array<float, 3> low_;
    std::vector<float> radii_; // of the levels
};

} // namespace rt_embree
