// SPDX-License-Identifier: Apache-2.0
//
// Numbers that look random, the same in each run: every pixel walks the same even sequence, each from a point
// of its own.
#pragma once
#include "trace.inl"

// A hash of 32 bits (C. Wellons' "lowbias32").
ARHOST_INLINE Int hash(Int x) {
    x = (x ^ shift_right_unsigned(x, 16)) * Int(0x7feb352d);
    x = (x ^ shift_right_unsigned(x, 15)) * Int(static_cast<int>(0x846ca68bu));
    return x ^ shift_right_unsigned(x, 16);
}

struct Random {
    Int pixel, seed;      // which sequence
    std::uint32_t sample; // which of the pixel's
};

struct Pair {
    Float u, v; // 0 to below 1
};

// The `count` pairs of one purpose are spread evenly over the square, those of a pixel's samples together, too
// (M. Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018: R2).
ARHOST_INLINE Pair pair(const Random &random, int purpose, int index, int count) {
    const Int own = hash(random.pixel ^ random.seed);
    const Int start = hash(own + Int(purpose * 2)), start_2 = hash(own + Int(purpose * 2 + 1));
    const std::uint32_t i = random.sample * static_cast<std::uint32_t>(count) + static_cast<std::uint32_t>(index);
    const auto unit = [](Int bits) __attribute__((always_inline)) {
        return to_float(shift_right_unsigned(bits, 8)) * Float(0x1p-24f);
    };
    return {unit(start + Int(static_cast<int>(i * 3242174889u))),
            unit(start_2 + Int(static_cast<int>(i * 2447445414u)))};
}
