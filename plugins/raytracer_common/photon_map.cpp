// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/photon_map.hpp"

#include "raytracer_common/scene_geometry.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace arhost::raytracer_common {
namespace {

struct Grid {
    std::array<float, 3> low;
    std::array<std::int32_t, 3> size;
    float cell;

    std::size_t count() const {
        return static_cast<std::size_t>(size[0]) * static_cast<std::size_t>(size[1]) *
               static_cast<std::size_t>(size[2]);
    }
    std::size_t index_of(const Photon &photon) const {
        std::size_t at[3];
        for (int i = 0; i < 3; ++i)
            at[i] = static_cast<std::size_t>(
                std::clamp(static_cast<std::int32_t>((photon.position[i] - low[i]) / cell), 0, size[i] - 1));
        return (at[2] * static_cast<std::size_t>(size[1]) + at[1]) * static_cast<std::size_t>(size[0]) + at[0];
    }
};

Grid make_grid(const std::array<float, 3> &low, const std::array<float, 3> &high, float cell) {
    Grid grid{low, {}, cell};
    for (std::size_t i = 0; i < 3; ++i)
        grid.size[i] = static_cast<std::int32_t>(std::min((high[i] - low[i]) / cell, 1e6f)) + 1;
    return grid;
}

void sort(std::span<const Photon> arrived, const Grid &grid, PhotonGrid &to) {
    to.size = grid.size;
    to.low = grid.low;
    to.radius = grid.cell / 2;
    to.starts.assign(grid.count() + 1, 0);
    for (const Photon &photon : arrived)
        ++to.starts[grid.index_of(photon) + 1];
    for (std::size_t i = 1; i < to.starts.size(); ++i)
        to.starts[i] += to.starts[i - 1];
    std::vector<std::int32_t> next(to.starts.begin(), to.starts.end() - 1);
    to.photons.resize(arrived.size());
    for (const Photon &photon : arrived)
        to.photons[static_cast<std::size_t>(next[grid.index_of(photon)]++)] = photon;
}

} // namespace

void PhotonMap::build(std::span<const Photon> photons) {
    std::vector<Photon> arrived;
    std::array<float, 3> low, high;
    low.fill(std::numeric_limits<float>::max());
    high.fill(std::numeric_limits<float>::lowest());
    for (const Photon &photon : photons) {
        if (photon.power[0] < 0)
            continue;
        arrived.push_back(photon);
        for (std::size_t i = 0; i < 3; ++i) {
            low[i] = std::min(low[i], photon.position[i]);
            high[i] = std::max(high[i], photon.position[i]);
        }
    }
    levels_.resize(arrived.empty() ? 0 : 1);
    if (arrived.empty())
        return;
    float extent = 1e-6f;
    for (std::size_t i = 0; i < 3; ++i)
        extent = std::max(extent, high[i] - low[i]);
    // The first radius follows from the area on which photons arrive: the cells of a coarse grid that they hit.
    const Grid coarse = make_grid(low, high, extent / 64);
    std::vector<bool> is_hit(coarse.count());
    for (const Photon &photon : arrived)
        is_hit[coarse.index_of(photon)] = true;
    const double area =
        static_cast<double>(std::ranges::count(is_hit, true)) * static_cast<double>(coarse.cell) * coarse.cell;
    const double radius =
        std::sqrt(area * photons_per_estimate / (std::numbers::pi * static_cast<double>(arrived.size())));
    Grid grid = make_grid(low, high, std::max(static_cast<float>(2 * radius), extent / 128));
    sort(arrived, grid, levels_[0]);
    const std::size_t max_cells = std::max<std::size_t>(8 * arrived.size(), 1 << 16);
    while (levels_.size() < max_levels) {
        grid = make_grid(low, high, grid.cell / 2);
        if (grid.count() > max_cells)
            break;
        sort(arrived, grid, levels_.emplace_back());
    }
}

void PhotonTargets::set(const arhost_scene &arena, std::vector<std::array<float, 4>> spheres) {
    spheres_ = std::move(spheres);
    cumulative_.clear();
    chances_.clear();
    const auto lamps = elements<arhost_light>(arena, arena.lights);
    std::vector<double> power;
    double sum = 0;
    for (const arhost_light &lamp : lamps)
        for (const auto &sphere : spheres_) {
            const double intensity = double{lamp.intensity[0]} + lamp.intensity[1] + lamp.intensity[2];
            double squared = 0;
            for (int i = 0; i < 3; ++i) {
                const double along = double{sphere[i]} - lamp.position[i];
                squared += along * along;
            }
            const double area = double{sphere[3]} * sphere[3];
            // The light on the sphere; the sphere may contain the lamp.
            power.push_back(intensity * area *
                            (lamp.falloff == ARHOST_FALLOFF_INVERSE_SQUARE ? 1 / std::max(squared, area) : 1));
            sum += power.back();
        }
    if (!(sum > 0))
        return;
    double before = 0;
    for (const double each : power) {
        before += each / sum;
        chances_.push_back(static_cast<float>(each / sum));
        cumulative_.push_back(static_cast<float>(before));
    }
    cumulative_.back() = 1;
}

} // namespace arhost::raytracer_common
