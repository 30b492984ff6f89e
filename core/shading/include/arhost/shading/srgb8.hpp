// SPDX-License-Identifier: Apache-2.0
//
// arhost/shading/srgb8.hpp: linear light to 8-bit sRGB, equal to the rounded exact formula, by one table look-up and
// one comparison.
#pragma once

#include "scalar.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>

namespace arhost::shading {

// 128 cells per power of two from 2^-13 (code 0) to 1: fine enough that a cell spans at most two codes. Floats in a
// cell differ only in their low 16 bits.
struct Srgb8Table {
    static constexpr float smallest = 0x1p-13f;
    static constexpr std::int32_t first_bits = (127 - 13) << 23, shift = 16, cell_count = 13 * 128 + 1;
    // Cell layout: the code at the cell's start, above the low-bits threshold from which the code is one higher
    // (1 << 16: none).
    static constexpr std::int32_t code_shift = 17, threshold_mask = (1 << code_shift) - 1, low_mask = 0xffff;
    std::int32_t cells[cell_count];

    std::int32_t operator()(float linear) const {
        const float x = linear > smallest ? (linear < 1 ? linear : 1.0f) : smallest; // NaN: black
        const auto bits = std::bit_cast<std::int32_t>(x);
        const std::int32_t cell = cells[(bits - first_bits) >> shift];
        return (cell >> code_shift) + ((bits & low_mask) >= (cell & threshold_mask));
    }
};

inline std::int32_t srgb8_exact(double linear) {
    return static_cast<std::int32_t>(code_8bit(srgb_encode(linear)));
}

inline Srgb8Table make_srgb8_table() {
    // The smallest float of each code: the formula's inverse, then single steps to the exact value.
    std::int32_t first_of_code[257] = {};
    first_of_code[256] = std::numeric_limits<std::int32_t>::max();
    for (std::int32_t code = 1; code <= 255; ++code) {
        auto bits = std::bit_cast<std::int32_t>(static_cast<float>(srgb_decode((code - 0.5) / 255)));
        while (srgb8_exact(std::bit_cast<float>(bits)) >= code)
            --bits;
        while (srgb8_exact(std::bit_cast<float>(bits)) < code)
            ++bits;
        first_of_code[code] = bits;
    }
    Srgb8Table table;
    std::int32_t code = 0;
    for (std::int32_t i = 0; i < Srgb8Table::cell_count; ++i) {
        const std::int32_t start = Srgb8Table::first_bits + (i << Srgb8Table::shift);
        while (first_of_code[code + 1] <= start)
            ++code;
        const std::int32_t threshold = std::min(first_of_code[code + 1] - start, 1 << Srgb8Table::shift);
        table.cells[i] = (code << Srgb8Table::code_shift) | threshold;
    }
    return table;
}

} // namespace arhost::shading
