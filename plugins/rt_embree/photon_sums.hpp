// SPDX-License-Identifier: Apache-2.0
//
// The power of the photons, summed over the cells of grids. Denoising makes up for the coarse cells; looking up a sum
// takes much less time than a density estimate from single photons.
#pragma once

#include "kernel.hpp"
#include "raytracer_common/photon_map.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace rt_embree {

class PhotonSums {
public:
    // `map`: of the same photons. `faces`: see TracePhotons.
    void build(const arhost::raytracer_common::PhotonMap &map,
               std::span<const arhost::raytracer_common::Photon> photons, std::span<const std::int8_t> faces,
               Photons &to);

private:
    std::vector<PhotonCell> cells_; // a hash table for each level
};

} // namespace rt_embree
