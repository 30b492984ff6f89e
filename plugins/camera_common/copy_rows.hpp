// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace arhost {

// Copies the rows of a plane. If both planes have the same stride, copies all rows and the bytes between them at
// once.
inline void copy_rows(const std::uint8_t *from, std::size_t from_stride, std::uint8_t *to, std::size_t to_stride,
                      std::size_t row_bytes, std::size_t rows) {
    if (from_stride == to_stride) {
        std::memcpy(to, from, from_stride * (rows - 1) + row_bytes);
        return;
    }
    for (std::size_t y = 0; y < rows; ++y)
        std::memcpy(to + y * to_stride, from + y * from_stride, row_bytes);
}

} // namespace arhost
