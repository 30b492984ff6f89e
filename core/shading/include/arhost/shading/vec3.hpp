// SPDX-License-Identifier: Apache-2.0
//
// arhost/shading/vec3.hpp: a vector of three components of any type Float.
#pragma once

namespace arhost::shading {

template <class Float> struct Vec3T {
    Float x, y, z;

    [[gnu::always_inline]] friend constexpr Vec3T operator+(Vec3T a, Vec3T b) {
        return {a.x + b.x, a.y + b.y, a.z + b.z};
    }
    [[gnu::always_inline]] friend constexpr Vec3T operator-(Vec3T a, Vec3T b) {
        return {a.x - b.x, a.y - b.y, a.z - b.z};
    }
    [[gnu::always_inline]] friend constexpr Vec3T operator-(Vec3T a) { return {-a.x, -a.y, -a.z}; }
    [[gnu::always_inline]] friend constexpr Vec3T operator*(Vec3T a, Vec3T b) {
        return {a.x * b.x, a.y * b.y, a.z * b.z};
    }
    [[gnu::always_inline]] friend constexpr Vec3T operator*(Vec3T a, Float s) { return {a.x * s, a.y * s, a.z * s}; }
    [[gnu::always_inline]] friend constexpr Float dot(Vec3T a, Vec3T b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
    [[gnu::always_inline]] friend constexpr Vec3T cross(Vec3T a, Vec3T b) {
        return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    }
};

} // namespace arhost::shading
