// SPDX-License-Identifier: Apache-2.0
//
// Vectors and matrices of packets.
#pragma once

constexpr float far_away = __builtin_inff();

ARHOST_INLINE Vec3 splat(const float *xyz) {
    return {Float(xyz[0]), Float(xyz[1]), Float(xyz[2])};
}
ARHOST_INLINE Vec3 black() {
    return {Float(0.0f), Float(0.0f), Float(0.0f)};
}
ARHOST_INLINE Vec3 white() {
    return {Float(1.0f), Float(1.0f), Float(1.0f)};
}

ARHOST_INLINE Int lane_numbers() {
    alignas(64) constexpr int numbers[lanes] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    return load(numbers);
}

// Returns m · a, where `m` is a column-major 3×3 matrix.
ARHOST_INLINE Vec3 transform(const float *m, Vec3 a) {
    return splat(m) * a.x + splat(m + 3) * a.y + splat(m + 6) * a.z;
}
