// SPDX-License-Identifier: Apache-2.0
//
// arhost/shading/srgb8.hpp: linear light to the 8-bit sRGB code that the exact formula rounds to, by one
// look-up and one comparison.
#pragma once

#include "scalar.hpp"

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

namespace arhost::shading {

// The cells split each power of two from 2^-13 (whose code is 0) to 1 into 128: finer than the codes
// anywhere, so that a cell has at most two codes.
struct Srgb8Table {
    static constexpr float smallest = 0x1p-13f;
    static constexpr std::int32_t first_bits = (127 - 13) << 23, shift = 23 - 7, cell_count = 13 * 128 + 1;

    struct Cell {
        float threshold;   // from here on, the code is one higher
        std::int32_t code; // at the cell's start
    };
    Cell cells[cell_count];

    // The cell of a value in [smallest, 1].
    static constexpr std::int32_t index(std::int32_t float_bits) { return (float_bits - first_bits) >> shift; }

    std::int32_t operator()(float linear) const {
        const float x = linear > smallest ? (linear < 1 ? linear : 1.0f) : smallest; // NaN: black
        const Cell &cell = cells[index(std::bit_cast<std::int32_t>(x))];
        return cell.code + (x >= cell.threshold);
    }
};

inline std::int32_t srgb8_exact(double linear) {
    return static_cast<std::int32_t>(code_8bit(srgb_encode(linear)));
}

inline Srgb8Table make_srgb8_table() {
    Srgb8Table table;
    for (std::int32_t i = 0; i < Srgb8Table::cell_count; ++i) {
        const float start = std::bit_cast<float>(Srgb8Table::first_bits + (i << Srgb8Table::shift));
        const std::int32_t code = srgb8_exact(start);
        // The smallest float of the next code: the formula's inverse, then step to the exact one.
        const float infinity = std::numeric_limits<float>::infinity();
        float threshold = infinity;
        if (code < 255) {
            threshold = static_cast<float>(srgb_decode((code + 0.5) / 255));
            while (srgb8_exact(threshold) > code)
                threshold = std::nextafter(threshold, 0.0f);
            while (srgb8_exact(threshold) <= code)
                threshold = std::nextafter(threshold, infinity);
        }
        table.cells[i] = {threshold, code};
    }
    return table;
}

} // namespace arhost::shading
