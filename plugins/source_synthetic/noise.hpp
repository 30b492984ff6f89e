// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace arhost::synthetic {

// A well-mixed number: the finalizer of MurmurHash3 (64 bits), by Austin Appleby.
inline std::uint64_t hashed(std::uint64_t x) {
    x ^= x >> 33;
    x *= 0xff51afd7ed558ccdULL;
    x ^= x >> 33;
    x *= 0xc4ceb9fe1a85ec53ULL;
    return x ^ x >> 33;
}

// 0 to 1, of a seed and two counters.
inline float random_share(std::uint64_t seed, std::int64_t a, std::int64_t b = 0) {
    const auto mixed = hashed(hashed(seed + static_cast<std::uint64_t>(a) * 0x9e3779b97f4a7c15ULL) +
                              static_cast<std::uint64_t>(b) * 0xc2b2ae3d27d4eb4fULL);
    return static_cast<float>(mixed >> 40) * 0x1p-24f;
}

inline std::int32_t floor_of(float x) {
    const auto i = static_cast<std::int32_t>(x);
    return i - (x < static_cast<float>(i));
}

// Smooth value noise, −1 to 1, one bump a unit, repeating after 256.
class Noise {
public:
    explicit Noise(std::uint64_t seed) : values_(side * side) {
        for (int i = 0; i < side * side; ++i)
            values_[i] = 2 * random_share(seed, i) - 1;
    }
    float operator()(float x, float y) const {
        const std::int32_t column = floor_of(x), row = floor_of(y);
        float a = x - static_cast<float>(column), b = y - static_cast<float>(row);
        a = a * a * (3 - 2 * a);
        b = b * b * (3 - 2 * b);
        const float *upper = &values_[(row & mask) * side], *lower = &values_[((row + 1) & mask) * side];
        const int left = column & mask, right = (column + 1) & mask;
        const float top = upper[left] + a * (upper[right] - upper[left]);
        const float bottom = lower[left] + a * (lower[right] - lower[left]);
        return top + b * (bottom - top);
    }

private:
    static constexpr int side = 256, mask = side - 1;
    std::vector<float> values_;
};

} // namespace arhost::synthetic
