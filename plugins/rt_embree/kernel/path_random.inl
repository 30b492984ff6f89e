// SPDX-License-Identifier: Apache-2.0
//
// Random numbers of the path integrator: an Owen-scrambled Sobol sequence (B. Burley, Practical Hash-based Owen
// Scrambling, JCGT 9(4), 2020), with other scramblings for each pixel, vertex and dimension. The pairs of any 2^k
// successive samples of a pixel, beginning at a multiple of 2^k, are a (0, k, 2)-net.
#pragma once
#include "scatter.inl"

enum Dimension : int {
    source_dimension = 64,
    light_dimension,
    scatter_dimension,
    choice_dimension,
    roulette_dimension,
    photon_dimension
};

ARHOST_INLINE Int reversed_bits(Int x) {
    const auto swapped = [](Int a, int distance, int mask) __attribute__((always_inline)) {
        return (shift_right_unsigned(a, distance) & Int(mask)) | ((a & Int(mask)) << Int(distance));
    };
    x = swapped(x, 1, 0x55555555);
    x = swapped(x, 2, 0x33333333);
    x = swapped(x, 4, 0x0f0f0f0f);
    x = swapped(x, 8, 0x00ff00ff);
    return swapped(x, 16, 0x0000ffff);
}

// Permutes the numbers so that bit i of the result depends on the bits 0 to i of `x` only (S. Laine and T. Karras,
// Stratified Sampling for Stochastic Transparency, EGSR 2011; constants of Burley).
ARHOST_INLINE Int nested_permutation(Int x, Int seed) {
    x = x + seed;
    x = x ^ (x * Int(0x6c50b47c));
    x = x ^ (x * Int(static_cast<int>(0xb82f1e52u)));
    x = x ^ (x * Int(static_cast<int>(0xc7afe638u)));
    return x ^ (x * Int(static_cast<int>(0x8d22f6e6u)));
}

// Returns the bits of Sobol's second dimension in reverse order, from the index: the Pascal matrix modulo 2.
ARHOST_INLINE Int pascal_of(Int index) {
    const auto add = [](Int a, int distance, int mask) __attribute__((always_inline)) {
        return a ^ (shift_right_unsigned(a, distance) & Int(mask));
    };
    index = add(index, 1, 0x55555555);
    index = add(index, 2, 0x33333333);
    index = add(index, 4, 0x0f0f0f0f);
    index = add(index, 8, 0x00ff00ff);
    return add(index, 16, 0x0000ffff);
}

// Returns the point with this index of a two-dimensional sequence.
ARHOST_INLINE Pair owen_pair(Int index, Int seed) {
    const Int shuffled = reversed_bits(nested_permutation(reversed_bits(index), seed ^ Int(0x2545f491)));
    const auto unit = [](Int bits) __attribute__((always_inline)) {
        return to_float(shift_right_unsigned(bits, 8)) * Float(0x1p-24f);
    };
    return {unit(reversed_bits(nested_permutation(shuffled, seed))),
            unit(reversed_bits(nested_permutation(pascal_of(shuffled), hash(seed))))};
}

// Returns pair `index` of the `count` pairs that a sample needs for a dimension of the paths' current vertex.
ARHOST_INLINE Pair path_pair(const Work &work, const Paths &paths, int dimension, int index, int count) {
    const Int pixel = paths.pixel + hash(work.seed) + Int(static_cast<int>(paths.depth << 12));
    const std::uint32_t i = work.sample * static_cast<std::uint32_t>(count) + static_cast<std::uint32_t>(index);
    return owen_pair(Int(static_cast<int>(i)), hash(hash(pixel) + Int(dimension)));
}
