// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/scene_geometry.hpp"

#include <arhost/shading/scalar.hpp>

#include <algorithm>
#include <cmath>

namespace arhost::raytracer_common {

bool is_identity(const float *world_from_object) {
    constexpr float identity[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    return std::equal(identity, identity + 12, world_from_object);
}

float scene_extent(const arhost_scene &arena) {
    double squared = 0;
    for (int i = 0; i < 3; ++i)
        squared += std::pow(double{arena.bounds_max[i]} - arena.bounds_min[i], 2);
    return static_cast<float>(std::sqrt(squared));
}

float quantized_alpha(float alpha) {
    return static_cast<float>(shading::code_8bit(double{alpha}) / 255);
}

Cofactors::Cofactors(const float *m) {
    for (int column = 0; column < 3; ++column) {
        const float *a = m + (column + 1) % 3 * 3, *b = m + (column + 2) % 3 * 3;
        for (int row = 0; row < 3; ++row) {
            const int i = (row + 1) % 3, j = (row + 2) % 3;
            values[3 * column + row] = double{a[i]} * b[j] - double{a[j]} * b[i];
        }
    }
    determinant = m[0] * values[0] + m[1] * values[1] + m[2] * values[2];
}

void Cofactors::write_normal_transform(float *to) const {
    double largest = 0;
    for (const double value : values)
        largest = std::max(largest, std::abs(value));
    for (const double value : values)
        *to++ = static_cast<float>(value / (determinant < 0 ? -largest : largest));
}

} // namespace arhost::raytracer_common
