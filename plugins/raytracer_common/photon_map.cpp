// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/photon_map.hpp"

#include "raytracer_common/scene_geometry.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <numbers>
#include <utility>

namespace arhost::raytracer_common {
namespace {

std::int32_t cell_at(float position, float low, float side) {
    return static_cast<std::int32_t>(std::clamp((position - low) / side, -1e9f, 1e9f));
}

void sort(std::span<const Photon> photons, const std::array<float, 3> &low, PhotonGrid &grid) {
    const std::size_t buckets = std::bit_ceil(2 * photons.size());
    const auto bucket_of = [&](const Photon &photon) {
        const float side = 2 * grid.radius;
        return PhotonGrid::hash(cell_at(photon.position[0], low[0], side), cell_at(photon.position[1], low[1], side),
                                cell_at(photon.position[2], low[2], side)) &
               (buckets - 1);
    };
    grid.starts.assign(buckets + 1, 0);
    for (const Photon &photon : photons)
        ++grid.starts[bucket_of(photon) + 1];
    for (std::size_t i = 1; i < grid.starts.size(); ++i)
        grid.starts[i] += grid.starts[i - 1];
    std::vector<std::int32_t> next(grid.starts.begin(), grid.starts.end() - 1);
    grid.numbers.resize(photons.size());
    for (std::size_t i = 0; i < photons.size(); ++i)
        grid.numbers[static_cast<std::size_t>(next[bucket_of(photons[i])]++)] = static_cast<std::int32_t>(i);
}

// The area on which photons arrive, in mm²: that of the cells of a coarse grid that they hit. `extent`: without the
// few photons that fly far away.
double lit_area(std::span<const Photon> photons, const std::array<float, 3> &low, float extent) {
    constexpr std::int32_t side = 64;
    const float cell = extent / side;
    std::vector<bool> is_hit(std::size_t{side} * side * side);
    for (const Photon &photon : photons) {
        std::size_t at = 0;
        for (std::size_t i = 0; i < 3; ++i)
            at = at * side +
                 static_cast<std::size_t>(std::clamp(cell_at(photon.position[i], low[i], cell), 0, side - 1));
        is_hit[at] = true;
    }
    return static_cast<double>(std::ranges::count(is_hit, true)) * cell * cell;
}

} // namespace

void PhotonMap::build(std::span<const Photon> photons, const PhotonMapOptions &options) {
    photons_.clear();
    levels_.clear();
    std::ranges::copy_if(photons, std::back_inserter(photons_),
                         [](const Photon &photon) { return photon.power[0] >= 0; });
    if (photons_.empty())
        return;
    std::array<float, 3> central_low;
    float extent = 1e-6f;
    std::vector<float> along(photons_.size());
    for (std::size_t i = 0; i < 3; ++i) {
        std::ranges::transform(photons_, along.begin(), [i](const Photon &photon) { return photon.position[i]; });
        const auto at = [&](double share) {
            const auto nth =
                along.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(along.size() - 1));
            std::ranges::nth_element(along, nth);
            return *nth;
        };
        low_[i] = *std::ranges::min_element(along);
        central_low[i] = at(0.02);
        extent = std::max(extent, at(0.98) - central_low[i]);
    }
    const double radius = std::sqrt(lit_area(photons_, central_low, extent) * photons_per_estimate /
                                    (std::numbers::pi * static_cast<double>(photons_.size())));
    levels_.resize(max_levels);
    levels_[0].radius = std::max(static_cast<float>(radius), extent * 1e-4f);
    for (std::size_t i = 0; i < 3; ++i)
        low_[i] -= options.shift[i] * 2 * levels_[0].radius;
    for (std::size_t i = 0; i < levels_.size(); ++i) {
        if (i > 0)
            levels_[i].radius = levels_[i - 1].radius / 2;
        if (options.sorts)
            sort(photons_, low_, levels_[i]);
    }
    mark_near(options.negligible);
}

void PhotonMap::mark_near(float negligible) {
    near_.assign(std::size_t{near_levels} * near_bits / 32, 0);
    using Cell = std::array<std::int32_t, 3>;
    const float side = 2 * levels_[0].radius;
    std::vector<std::pair<Cell, float>> powers(photons_.size());
    std::ranges::transform(photons_, powers.begin(), [&](const Photon &photon) {
        Cell cell;
        for (std::size_t i = 0; i < 3; ++i)
            cell[i] = cell_at(photon.position[i], low_[i], side);
        return std::pair(cell, std::max({photon.power[0], photon.power[1], photon.power[2]}));
    });
    std::ranges::sort(powers);
    std::vector<Cell> cells; // with enough light
    for (auto next = powers.begin(); next != powers.end();) {
        const Cell cell = next->first;
        float power = 0;
        for (; next != powers.end() && next->first == cell; ++next)
            power += next->second;
        if (power >= negligible * side * side)
            cells.push_back(cell);
    }
    for (std::int32_t level = 0; level < near_levels; ++level) {
        std::int32_t *const bits = near_.data() + std::ptrdiff_t{level} * near_bits / 32;
        for (const Cell &cell : cells)
            for (int neighbour = 0; neighbour < 27; ++neighbour) {
                const std::uint32_t bit =
                    PhotonGrid::hash(cell[0] + neighbour % 3 - 1, cell[1] + neighbour / 3 % 3 - 1,
                                     cell[2] + neighbour / 9 - 1) %
                    near_bits;
                bits[bit / 32] |= static_cast<std::int32_t>(1u << bit % 32);
            }
        for (Cell &cell : cells)
            for (std::int32_t &coordinate : cell)
                coordinate >>= 1;
        std::ranges::sort(cells);
        cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
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
