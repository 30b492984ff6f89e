// SPDX-License-Identifier: Apache-2.0
//
// Photons: light that mirrors and glass send from lamps onto other surfaces (H. W. Jensen, Global Illumination
// using Photon Maps, EGWR 1996), sorted into the cells of a regular grid.
#pragma once

#include <arhost/scene.h>

#include <algorithm>
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

constexpr std::uint32_t max_photons = 1 << 20; // of an image

// Returns the number of photons of an image.
constexpr std::uint32_t photon_count(std::uint32_t photons_per_sample, std::uint32_t samples) {
    return static_cast<std::uint32_t>(
        std::min<std::uint64_t>(std::uint64_t{photons_per_sample} * samples, max_photons));
}

// A hash table of the cells of a regular grid. Cells share a bucket by chance, so compare the cell of each photon.
struct PhotonGrid {
    std::vector<std::int32_t> numbers; // of photons, by bucket
    std::vector<std::int32_t> starts;  // first element of `numbers` of each bucket, and its size
    float radius;                      // mm: of density estimates; half of a cell's side

    // The bucket of a cell is this number modulo the number of buckets, which is a power of two. Cell numbers are not
    // negative.
    static std::uint32_t hash(std::int32_t x, std::int32_t y, std::int32_t z) {
        return static_cast<std::uint32_t>(x) * 73856093u ^ static_cast<std::uint32_t>(y) * 19349663u ^
               static_cast<std::uint32_t>(z) * 83492791u;
    }
};

struct PhotonMapOptions {
    bool sorts = true;            // else the levels only have a radius
    float negligible = 0;         // irradiance / π; near() does not have cells that receive less from photons
    std::array<float, 3> shift{}; // of the grids, in cells of the first level: 0 to 1
};

// Grids of the same photons whose cells are half as large from level to level: where photons are dense, a density
// estimate needs a small radius.
class PhotonMap {
public:
    static constexpr std::size_t max_levels = 6;
    static constexpr int photons_per_estimate = 24; // about

    // Keeps the photons that arrived somewhere.
    void build(std::span<const Photon> photons, const PhotonMapOptions &options = {});

    std::span<const Photon> photons() const { return photons_; }
    std::span<const PhotonGrid> levels() const { return levels_; } // empty if no photon arrived
    // near_bits bits for each of near_levels grids, whose cells are as large as those of the first level, and twice
    // as large from grid to grid. The bit of a cell is PhotonGrid::hash() modulo near_bits. It is set for cells that
    // contain photons, and for their neighbours.
    static constexpr std::int32_t near_bits = 1 << 16, near_levels = 6;
    std::span<const std::int32_t> near() const { return near_; }
    const std::array<float, 3> &low() const { return low_; } // mm: corner of cell (0, 0, 0) of all grids

private:
    void mark_near(float negligible);

    std::vector<Photon> photons_;
    std::vector<PhotonGrid> levels_;
    std::vector<std::int32_t> near_;
    std::array<float, 3> low_{};
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
