// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace arhost::synthetic {

// Hash function: the 64-bit finalizer of MurmurHash3, by Austin Appleby.
inline std::uint64_t hashed(std::uint64_t x) {
    x ^= x >> 33;
    x *= 0xff51afd7ed558ccdULL;
    x ^= x >> 33;
    x *= 0xc4ceb9fe1a85ec53ULL;
    return x ^ x >> 33;
}

// Returns a pseudo-random number from 0 to 1 that depends only on a seed and two counters.
inline float random_unit(std::uint64_t seed, std::int64_t a, std::int64_t b) {
    const auto mixed = hashed(hashed(seed + static_cast<std::uint64_t>(a) * 0x9e3779b97f4a7c15ULL) +
                              static_cast<std::uint64_t>(b) * 0xc2b2ae3d27d4eb4fULL);
    return static_cast<float>(mixed >> 40) * 0x1p-24f;
}

} // namespace arhost::synthetic
