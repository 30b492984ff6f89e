// SPDX-License-Identifier: Apache-2.0
//
// Photons: light that mirrors and glass send from lamps onto other surfaces (H. W. Jensen, Global Illumination
// using Photon Maps, EGWR 1996), sorted into the cells of a regular grid.
#pragma once

#include <arhost/scene.h>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace arhost::raytracer_common {

struct Photon {
    float position[3];  // mm
    float direction[3]; // unit vector along which the photon arrives
    float power[3];     // irradiance times area (mm²), divided by π; negative red: the photon arrived nowhere
};

// Photons, sorted into the cells of a regular grid. Those of cell (x, y, z) begin at index
// starts[(z·size[1] + y)·size[0] + x] and end where those of the next cell begin.
struct PhotonGrid {
    std::vector<Photon> photons;
    std::vector<std::int32_t> starts;
    std::array<std::int32_t, 3> size; // cells
    std::array<float, 3> low;         // mm: corner of cell (0, 0, 0)
    float radius;                     // mm: of density estimates; half of a cell's side
};

// Grids of the same photons whose cells are half as large from level to level: where photons are dense, a density
// estimate needs a small radius.
class PhotonMap {
public:
    static constexpr std::size_t max_levels = 6;
    static constexpr int photons_per_estimate = 24; // about

    // Sorts the photons that arrived somewhere.
    void build(std::span<const Photon> photons);
    std::span<const PhotonGrid> levels() const { return levels_; } // empty if no photon arrived

private:
    std::vector<PhotonGrid> levels_;
};

// Chances with which photons are sent from each lamp towards each of the spheres around the mirrors and glass
// objects.
class PhotonTargets {
public:
    // `spheres`: centre and radius, mm.
    void set(const arhost_scene &arena, std::vector<std::array<float, 4>> spheres);

    bool empty() const { return cumulative_.empty(); }
    std::span<const std::array<float, 4>> spheres() const { return spheres_; }
    // For lamp i and sphere j, at index i · (number of spheres) + j: the cumulative chance, and the chance of the
    // pair.
    std::span<const float> cumulative() const { return cumulative_; }
    std::span<const float> chances() const { return chances_; }

private:
    std::vector<std::array<float, 4>> spheres_;
    std::vector<float> cumulative_, chances_;
};

} // namespace arhost::raytracer_common
