// SPDX-License-Identifier: Apache-2.0
#include "common_view/arena.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace arhost::view {

bool is_identity(const float *world_from_object) {
    constexpr float identity[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    return std::equal(identity, identity + 12, world_from_object);
}

float largest_extent(const arhost_scene &arena, const arhost_geometry &geometry, const std::byte *points,
                     std::uint32_t stride) {
    float largest = 0;
    if (geometry.type == ARHOST_SPHERES) {
        for (std::uint32_t i = 0; i < geometry.positions.count; ++i) {
            float sphere[4];
            std::memcpy(sphere, points + std::size_t{stride} * i, sizeof sphere);
            largest = std::max(largest, 2 * sphere[3]);
        }
        return largest;
    }
    const std::byte *triangle = bytes(arena) + geometry.indices.offset;
    for (std::uint32_t i = 0; i < geometry.indices.count; ++i, triangle += geometry.indices.stride) {
        std::uint32_t corners[3];
        std::memcpy(corners, triangle, sizeof corners);
        float corner[3][3];
        for (int number = 0; number < 3; ++number)
            std::memcpy(corner[number], points + std::size_t{stride} * corners[number], sizeof corner[number]);
        for (int axis = 0; axis < 3; ++axis) {
            const auto [low, high] = std::minmax({corner[0][axis], corner[1][axis], corner[2][axis]});
            largest = std::max(largest, high - low);
        }
    }
    return largest;
}

float extent_in_world(float largest_extent, const float *m) {
    float scale = 0;
    for (const float *column : {m, m + 3, m + 6})
        scale = std::max(scale, std::hypot(column[0], column[1], column[2]));
    return largest_extent * scale + std::max({std::abs(m[9]), std::abs(m[10]), std::abs(m[11])});
}

Cofactors::Cofactors(const float *m) {
    for (int column = 0; column < 3; ++column) {
        const float *a = m + (column + 1) % 3 * 3, *b = m + (column + 2) % 3 * 3;
        for (int row = 0; row < 3; ++row) {
            const int i = (row + 1) % 3, j = (row + 2) % 3;
            of[3 * column + row] = double{a[i]} * b[j] - double{a[j]} * b[i];
        }
    }
    determinant = m[0] * of[0] + m[1] * of[1] + m[2] * of[2];
}

void Cofactors::put_normal_transform(float *to) const {
    double largest = 0;
    for (const double value : of)
        largest = std::max(largest, std::abs(value));
    for (const double value : of)
        *to++ = static_cast<float>(value / (determinant < 0 ? -largest : largest));
}

} // namespace arhost::view
