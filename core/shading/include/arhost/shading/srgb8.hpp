// SPDX-License-Identifier: Apache-2.0
//
// arhost/shading/srgb8.hpp: converts linear light to 8-bit sRGB with one table look-up and one comparison. The result
// equals the rounded result of the exact formula.
#pragma once

#include "scalar.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>

namespace arhost::shading {

// Divides each power of two from 2^-13 (code 0) to 1 into 128 cells, so that a cell contains at most two codes. The
// floats in a cell differ only in their low 16 bits.
struct Srgb8Table {
    static constexpr float smallest = 0x1p-13f;
    static constexpr std::int32_t first_bits = (127 - 13) << 23, shift = 16, cell_count = 13 * 128 + 1;
    // A cell contains two numbers. Upper bits, from code_shift on: the code of the smallest float in the cell. Lower
    // bits: the threshold; floats whose low 16 bits are at least the threshold have the next code. A threshold of
    // 1 << 16 means that all floats in the cell have the same code.
    static constexpr std::int32_t code_shift = 17, threshold_mask = (1 << code_shift) - 1, low_mask = 0xffff;
    std::int32_t cells[cell_count];

    std::int32_t operator()(float linear) const {
        const float x = linear > smallest ? (linear < 1 ? linear : 1.0f) : smallest; // NaN becomes black
        return code_of_bits(std::bit_cast<std::int32_t>(x));
    }
    // `bits`: those of a float from `smallest` to 1.
    std::int32_t code_of_bits(std::int32_t bits) const {
        const std::int32_t cell = cells[(bits - first_bits) >> shift];
        return (cell >> code_shift) + ((bits & low_mask) >= (cell & threshold_mask));
    }
};

inline std::int32_t srgb8_exact(double linear) {
    return static_cast<std::int32_t>(code_8bit(srgb_encode(linear)));
}

inline Srgb8Table make_srgb8_table() {
    // Finds the smallest float of each code: starts at the inverse of the formula and steps to neighbouring floats.
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
