// SPDX-License-Identifier: Apache-2.0
//
// Deterministic quasi-random numbers. All pixels use the same sequence; each pixel starts at an offset that is a hash
// of its position.
#pragma once
#include "trace.inl"

ARHOST_INLINE std::uint32_t shift_right_unsigned(std::uint32_t a, int bits) {
    return a >> bits;
}

// Returns a 32-bit hash of `x` ("lowbias32" by C. Wellons). Word: Int, or std::uint32_t for a number of all lanes.
template <class Word> ARHOST_INLINE Word hash(Word x) {
    x = (x ^ shift_right_unsigned(x, 16)) * Word(0x7feb352d);
    x = (x ^ shift_right_unsigned(x, 15)) * Word(static_cast<int>(0x846ca68bu));
    return x ^ shift_right_unsigned(x, 16);
}

struct Random {
    Int pixel, seed;      // determine the start of the sequence
    std::uint32_t sample; // index among the samples of the pixel
};

struct Pair {
    Float u, v; // [0, 1)
};

// Returns pair `index` of the `count` pairs that a sample needs for `purpose`. These pairs are evenly distributed
// over the unit square. The pairs of all samples of a pixel are evenly distributed, too (R2 sequence: M. Roberts, The
// Unreasonable Effectiveness of Quasirandom Sequences, 2018).
ARHOST_INLINE Pair pair(const Random &random, int purpose, int index, int count) {
    const Int base = hash(random.pixel ^ random.seed);
    const Int start = hash(base + Int(purpose * 2)), start_2 = hash(base + Int(purpose * 2 + 1));
    const std::uint32_t i = random.sample * static_cast<std::uint32_t>(count) + static_cast<std::uint32_t>(index);
    const auto unit = [](Int bits) __attribute__((always_inline)) {
        return to_float(shift_right_unsigned(bits, 8)) * Float(0x1p-24f);
    };
    return {unit(start + Int(static_cast<int>(i * 3242174889u))),
            unit(start_2 + Int(static_cast<int>(i * 2447445414u)))};
}
