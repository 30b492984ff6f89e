// SPDX-License-Identifier: Apache-2.0
//
// Access to a scene's arena (arhost/scene.h).
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

// A buffer of T.
template <class T> std::span<const T> elements(const arhost_scene &arena, const arhost_buffer &buffer) {
    return {reinterpret_cast<const T *>(bytes(arena) + buffer.offset), buffer.count};
}

// `world_from_object`: a 3×4 transform, column by column, here and below.
bool is_identity(const float *world_from_object);

// The largest distance of an object's points from its origin, along each world axis, in mm; `low` and `high` are its
// box in object space. Excludes the translation, which offset_from_surface() counts as part of the ray.
template <class Number>
void object_extent(const Number (&low)[3], const Number (&high)[3], const float *world_from_object, float (&to)[3]) {
    for (int row = 0; row < 3; ++row) {
        to[row] = 0;
        for (int axis = 0; axis < 3; ++axis)
            to[row] += std::abs(world_from_object[3 * axis + row]) *
                       static_cast<float>(std::max(std::abs(low[axis]), std::abs(high[axis])));
    }
}

// The cofactors of a transform's 3×3 part, for its inverse and normal transform. The inverse is
// cofactor[row][column] / determinant, transposed.
struct Cofactors {
    double values[9]; // column by column
    double determinant;

    explicit Cofactors(const float *world_from_object);
    // The inverse transpose, scaled so that its largest element is 1 (normals are normalized later). The
    // determinant's sign keeps a mirrored object's normals pointing outwards. Column by column.
    void write_normal_transform(float *to) const;
};

} // namespace arhost::raytracer_common
