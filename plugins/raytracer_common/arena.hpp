// SPDX-License-Identifier: Apache-2.0
//
// How ray tracers read a scene's arena (arhost/scene.h).
#pragma once

#include <arhost/scene.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

namespace arhost::raytracer_common {

inline const std::byte *bytes(const arhost_scene &arena) {
    return reinterpret_cast<const std::byte *>(&arena);
}

// Of a buffer whose elements are T.
template <class T> std::span<const T> elements(const arhost_scene &arena, const arhost_buffer &buffer) {
    return {reinterpret_cast<const T *>(bytes(arena) + buffer.offset), buffer.count};
}

// Of a transform's 12 numbers, column by column.
bool is_identity(const float *world_from_object);

// How far an object goes from its own origin, where its box there is low to high; turned into the world, mm along
// each of its axes. How far a transform moves it is counted as a part of the rays' way (offset_from_surface).
template <class Number>
void object_extent(const Number (&low)[3], const Number (&high)[3], const float *world_from_object, float (&to)[3]) {
    for (int row = 0; row < 3; ++row) {
        to[row] = 0;
        for (int axis = 0; axis < 3; ++axis)
            to[row] += std::abs(world_from_object[3 * axis + row]) *
                       static_cast<float>(std::max(std::abs(low[axis]), std::abs(high[axis])));
    }
}

// What brings normals to the world and points back from there, of a transform's first 9 numbers. The inverse is
// cofactor[row][column] / determinant, read by columns.
struct Cofactors {
    double of[9]; // column by column
    double determinant;

    explicit Cofactors(const float *world_from_object);
    // Normals get their length later, so that of the inverse transposed only the determinant's sign counts: it keeps
    // a mirrored object's outside outside. Column by column; the largest number is 1.
    void put_normal_transform(float *to) const;
};

} // namespace arhost::raytracer_common
