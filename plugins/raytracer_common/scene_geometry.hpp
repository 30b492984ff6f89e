// SPDX-License-Identifier: Apache-2.0
//
// Functions to read a scene's arena (arhost/scene.h) and transforms.
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

// Returns the elements of a buffer of the arena, which must have type T and no padding between elements.
template <class T> std::span<const T> elements(const arhost_scene &arena, const arhost_buffer &buffer) {
    return {reinterpret_cast<const T *>(bytes(arena) + buffer.offset), buffer.count};
}

// Returns the image of a texture.
inline const arhost_texel_image &image_of(const arhost_scene &arena, const arhost_texture &texture) {
    return elements<arhost_texel_image>(arena, arena.images)[texture.image];
}
// Returns the image of the environment, which the scene must have.
inline const arhost_texel_image &environment_image(const arhost_scene &arena) {
    return image_of(arena, elements<arhost_texture>(arena, arena.textures)[arena.environment.texture]);
}

float scene_extent(const arhost_scene &arena); // length of the diagonal of the scene's bounds, mm

// Here and below, `world_from_object` is a 3×4 matrix, column-major.
bool is_identity(const float *world_from_object);

// Writes to `to` how far an object's points are at most from the object's origin along each world axis, in mm. `low`
// and `high` are the object's bounding box in object space. The translation is not included:
// offset_from_surface() accounts for it with the hit position.
template <class Number>
void object_extent(const Number (&low)[3], const Number (&high)[3], const float *world_from_object, float (&to)[3]) {
    for (int row = 0; row < 3; ++row) {
        to[row] = 0;
        for (int axis = 0; axis < 3; ++axis)
            to[row] += std::abs(world_from_object[3 * axis + row]) *
                       static_cast<float>(std::max(std::abs(low[axis]), std::abs(high[axis])));
    }
}

// Writes the bounding box of a transformed box (Arvo, Transforming Axis-Aligned Bounding Boxes, Graphics Gems 1990).
template <class Number>
void transform_box(const Number (&low)[3], const Number (&high)[3], const float *world_from_object,
                   double (&to_low)[3], double (&to_high)[3]) {
    for (int row = 0; row < 3; ++row) {
        to_low[row] = to_high[row] = world_from_object[9 + row];
        for (int axis = 0; axis < 3; ++axis) {
            const double factor = world_from_object[3 * axis + row], a = factor * low[axis], b = factor * high[axis];
            to_low[row] += std::min(a, b);
            to_high[row] += std::max(a, b);
        }
    }
}

// Rounds `alpha` to a multiple of 1/255, so that rounding errors of the shading do not change the 8-bit code.
float quantized_alpha(float alpha);

// The cofactors of the 3×3 part of a transform. The inverse of the 3×3 part is the transpose of the matrix
// cofactor[row][column] / determinant.
struct Cofactors {
    double values[9]; // column-major
    double determinant;

    explicit Cofactors(const float *world_from_object);
    // Writes the matrix that transforms normals, column-major: the inverse transpose, scaled so that its largest
    // element is 1, because normals are normalized later. The sign of the determinant is retained, so the normals of
    // a mirrored object still point outwards.
    void write_normal_transform(float *to) const;
};

} // namespace arhost::raytracer_common
