// SPDX-License-Identifier: Apache-2.0
#include "ray_table.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace rt_embree {
namespace {

using Direction = arhost::shading::Vec3T<double>;

constexpr std::int32_t block = 4, lanes = block * block;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

constexpr std::int32_t blocks_in(std::int32_t side) {
    return (side + block - 1) / block;
}

} // namespace

RayTable::RayTable(const arhost_intrinsics &intrinsics, bool has_derivatives, ThreadPool &threads)
    : dimensions_(intrinsics.distortion == ARHOST_DISTORTION_FISHEYE ? 3 : 2), has_derivatives_(has_derivatives) {
    const auto width = static_cast<std::int32_t>(intrinsics.width);
    const auto height = static_cast<std::int32_t>(intrinsics.height);
    tiles_across_ = (width + tile_side - 1) / tile_side;
    std::size_t block_count = 0;
    for (std::int32_t y = 0; y < height; y += tile_side)
        for (std::int32_t x = 0; x < width; x += tile_side) {
            const Rectangle pixels{x, y, std::min(x + tile_side, width), std::min(y + tile_side, height)};
            tiles_.push_back({pixels, block_count});
            block_count += static_cast<std::size_t>(blocks_in(pixels.x1 - x)) * blocks_in(pixels.y1 - y);
        }
    blocks_.resize(block_count * rays().block_size());
    windows_.resize(tiles_.size());

    const arhost::shading::Lens lens(intrinsics);
    threads.for_each(tiles_.size(), [&](std::size_t tile, std::size_t) { fill(tile, lens); });
}

void RayTable::fill(std::size_t tile, const arhost::shading::Lens &lens) {
    const auto direction_at = [&](double x, double y) { return lens.ray({x, y}).value_or(Direction{nan, nan, nan}); };
    const double infinity = std::numeric_limits<double>::infinity();
    Window window{infinity, infinity, -infinity, -infinity, false};
    const auto widen = [&](Direction d) {
        if (std::isnan(d.x))
            return;
        if (d.z < 1e-3)
            window.unbounded = true;
        window.x0 = std::min(window.x0, d.x / d.z);
        window.y0 = std::min(window.y0, d.y / d.z);
        window.x1 = std::max(window.x1, d.x / d.z);
        window.y1 = std::max(window.y1, d.y / d.z);
    };
    const auto store = [&](Direction d, float *to) {
        to[0] = static_cast<float>(d.x);
        to[lanes] = static_cast<float>(d.y);
        if (dimensions_ == 3)
            to[2 * lanes] = static_cast<float>(d.z);
    };

    const Rectangle &pixels = tiles_[tile].pixels;
    const std::int32_t width = block * blocks_in(pixels.x1 - pixels.x0),
                       height = block * blocks_in(pixels.y1 - pixels.y0);
    // Directions at points that are (dx, dy) px from the centres of `columns` × `rows` pixels.
    const auto grid = [&](std::int32_t columns, std::int32_t rows, double dx, double dy) {
        std::vector<Direction> directions;
        directions.reserve(static_cast<std::size_t>(columns) * rows);
        for (std::int32_t row = 0; row < rows; ++row)
            for (std::int32_t column = 0; column < columns; ++column)
                directions.push_back(direction_at(pixels.x0 + column + dx, pixels.y0 + row + dy));
        return directions;
    };
    const std::vector<Direction> centres = grid(width, height, 0, 0);
    std::vector<Direction> sides, tops; // left sides of pixels and right ones of the last; likewise tops and bottoms
    if (has_derivatives_) {
        sides = grid(width + 1, height, -0.5, 0);
        tops = grid(width, height + 1, 0, -0.5);
    }
    float *to = blocks_.data() + tiles_[tile].first_block * rays().block_size();
    for (std::int32_t y = 0; y < height; y += block)
        for (std::int32_t x = 0; x < width; x += block, to += rays().block_size())
            for (std::int32_t lane = 0; lane < lanes; ++lane) {
                const std::int32_t column = x + lane % block, row = y + lane / block;
                const std::size_t at = static_cast<std::size_t>(row) * width + column;
                const Direction &centre = centres[at];
                widen(centre);
                store(centre, to + lane);
                if (!has_derivatives_)
                    continue;
                const std::size_t left = at + row; // rows of `sides` have one more element
                const Direction along_row = sides[left + 1] - sides[left], along_column = tops[at + width] - tops[at];
                store(along_row, to + lane + lanes * dimensions_);
                store(along_column, to + lane + 2 * lanes * dimensions_);
                for (const double i : {-0.5, 0.5})
                    for (const double j : {-0.5, 0.5})
                        widen(centre + along_row * i + along_column * j);
            }
    windows_[tile] = window;
}

arhost::shading::Vec3T<float> RayTable::direction(std::int32_t x, std::int32_t y) const {
    const Tile &tile = tiles_[static_cast<std::size_t>(y / tile_side) * tiles_across_ + x / tile_side];
    const std::int32_t dx = x - tile.pixels.x0, dy = y - tile.pixels.y0;
    const std::size_t number =
        tile.first_block + dy / block * blocks_in(tile.pixels.x1 - tile.pixels.x0) + dx / block;
    const float *at = blocks_.data() + number * rays().block_size() + dy % block * block + dx % block;
    return {at[0], at[lanes], dimensions_ == 3 ? at[2 * lanes] : 1};
}

} // namespace rt_embree
