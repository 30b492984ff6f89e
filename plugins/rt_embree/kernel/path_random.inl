// SPDX-License-Identifier: Apache-2.0
//
// Random numbers of the path integrator: an Owen-scrambled Sobol sequence (B. Burley, Practical Hash-based Owen
// Scrambling, JCGT 9(4), 2020) of samples, which each pixel shifts by the bits of a pair of another such sequence of
// pixels in Z order (A. Ahmed and P. Wonka, Screen-space Blue-noise Diffusion of Monte Carlo Sampling Error via
// Hierarchical Ordering of Pixels, ACM TOG 39(6), 2020). Each tile, vertex and dimension has its own scramblings. So
// the pairs of any 2^k successive samples of a pixel, beginning at a multiple of 2^k, are a (0, k, 2)-net. So are the
// pairs of one sample of all pixels of an aligned square of 2^(k/2) px in a tile of full width, for even k; therefore
// the errors of neighbours differ.
#pragma once
#include "scatter.inl"

enum Dimension : int {
    source_dimension = 64,
    light_dimension,
    scatter_dimension,
    choice_dimension,
    roulette_dimension,
    photon_dimension,
    facet_dimension
};

ARHOST_INLINE std::uint32_t reversed_bytes(std::uint32_t x) {
    return __builtin_bswap32(x);
}
// Word: Int, or std::uint32_t for a number of all lanes.
template <class Word> ARHOST_INLINE Word reversed_bits(Word x) {
    const auto swapped = [](Word a, int distance, int mask) __attribute__((always_inline)) {
        return (shift_right_unsigned(a, distance) & Word(mask)) | ((a & Word(mask)) << Word(distance));
    };
    x = swapped(x, 1, 0x55555555);
    x = swapped(x, 2, 0x33333333);
    return reversed_bytes(swapped(x, 4, 0x0f0f0f0f));
}

// Permutes the numbers so that bit i of the result depends on the bits 0 to i of `x` only (S. Laine and T. Karras,
// Stratified Sampling for Stochastic Transparency, EGSR 2011; constants of Burley).
template <class Word> ARHOST_INLINE Word nested_permutation(Word x, Word seed) {
    x = x + seed;
    x = x ^ (x * Word(0x6c50b47c));
    x = x ^ (x * Word(static_cast<int>(0xb82f1e52u)));
    x = x ^ (x * Word(static_cast<int>(0xc7afe638u)));
    return x ^ (x * Word(static_cast<int>(0x8d22f6e6u)));
}

// Returns the bits of Sobol's second dimension in reverse order, from the index: the Pascal matrix modulo 2.
template <class Word> ARHOST_INLINE Word pascal_of(Word index) {
    const auto add = [](Word a, int distance, int mask) __attribute__((always_inline)) {
        return a ^ (shift_right_unsigned(a, distance) & Word(mask));
    };
    index = add(index, 1, 0x55555555);
    index = add(index, 2, 0x33333333);
    index = add(index, 4, 0x0f0f0f0f);
    index = add(index, 8, 0x00ff00ff);
    return add(index, 16, 0x0000ffff);
}

template <class Word> struct PairBits {
    Word u, v; // 32 bits after the binary point
};

ARHOST_INLINE Pair pair_of(Int u, Int v) {
    const auto unit = [](Int bits) __attribute__((always_inline)) {
        return to_float(shift_right_unsigned(bits, 8)) * Float(0x1p-24f);
    };
    return {unit(u), unit(v)};
}

// Returns the point with this index of a two-dimensional sequence.
template <class Word> ARHOST_INLINE PairBits<Word> owen_pair(Word index, Word seed) {
    const Word shuffled = reversed_bits(nested_permutation(reversed_bits(index), seed ^ Word(0x2545f491)));
    return {reversed_bits(nested_permutation(shuffled, seed)),
            reversed_bits(nested_permutation(pascal_of(shuffled), hash(seed)))};
}

// Returns the number in Z order of a pixel of a tile: bits 2i and 2i + 1 are bit i of its column and of its row.
// `pixel`: the number of the pixel if blocks of 4×4 px follow each other row by row, eight in a row. Narrower tiles
// have fewer in a row; there, the result is a permutation, but not the Z order.
ARHOST_INLINE Int z_order_of(Int pixel) {
    return (pixel & Int(0x219)) | ((pixel & Int(0x22)) << Int(1)) | (shift_right_unsigned(pixel, 1) & Int(0x82)) |
           (shift_right_unsigned(pixel, 2) & Int(0x20)) | ((pixel & Int(0x40)) << Int(2));
}

// The pairs that the samples need for a dimension of the paths' current vertex.
struct PathPairs {
    std::uint32_t sample, seed;
    PairBits<Int> shift;

    // Returns pair `index` of `count` for each sample.
    ARHOST_INLINE Pair pair(int index, int count) const {
        const PairBits<std::uint32_t> bits =
            owen_pair(sample * static_cast<std::uint32_t>(count) + static_cast<std::uint32_t>(index), seed);
        return pair_of(Int(static_cast<int>(bits.u)) ^ shift.u, Int(static_cast<int>(bits.v)) ^ shift.v);
    }
};
ARHOST_INLINE PathPairs path_pairs(const Work &work, const Paths &paths, int dimension) {
    const std::uint32_t seed =
        hash(hash(hash(work.seed) + (paths.depth << 12)) + static_cast<std::uint32_t>(dimension));
    // Pixel numbers above those of a tile are of changes of the light of catchers.
    return {work.sample, seed,
            owen_pair(z_order_of(paths.pixel),
                      hash(Int(static_cast<int>(seed)) + shift_right_unsigned(paths.pixel, 10)))};
}
ARHOST_INLINE Pair path_pair(const Work &work, const Paths &paths, int dimension) {
    return path_pairs(work, paths, dimension).pair(0, 1);
}
