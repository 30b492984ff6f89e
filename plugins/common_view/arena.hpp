// SPDX-License-Identifier: Apache-2.0
//
// How ray tracers read a scene's arena (arhost/scene.h).
#pragma once

#include <arhost/scene.h>

#include <cstddef>
#include <cstdint>
#include <span>

namespace arhost::view {

inline const std::byte *bytes(const arhost_scene &arena) {
    return reinterpret_cast<const std::byte *>(&arena);
}

// Of a buffer whose elements are T.
template <class T> std::span<const T> elements(const arhost_scene &arena, const arhost_buffer &buffer) {
    return {reinterpret_cast<const T *>(bytes(arena) + buffer.offset), buffer.count};
}

// Of a transform's 12 numbers, column by column.
bool is_identity(const float *world_from_object);

// How large the geometry's largest triangle or sphere is along an axis. Its points are read at `points`, `stride`
// bytes from one to the next.
float largest_extent(const arhost_scene &arena, const arhost_geometry &geometry, const std::byte *points,
                     std::uint32_t stride);
// The same in the world, and how far the transform moves it: where rays meet the object single precision loses a part
// of this.
float extent_in_world(float largest_extent, const float *world_from_object);

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

} // namespace arhost::view
