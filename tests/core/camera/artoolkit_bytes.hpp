// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>
#include <string>
#include <vector>

namespace arhost::test {

// Camera parameters of ARToolKit, in the order of the file.
struct ArtoolkitParameters {
    std::uint32_t xsize = 640, ysize = 480;
    std::vector<double> mat, dist_factor;

    std::string bytes() const {
        std::string text = big_endian(xsize, 4) + big_endian(ysize, 4);
        for (const auto *numbers : {&mat, &dist_factor})
            for (const double number : *numbers)
                text += big_endian(std::bit_cast<std::uint64_t>(number), 8);
        return text;
    }

private:
    static std::string big_endian(std::uint64_t value, int byte_size) {
        std::string text;
        for (int shift = 8 * (byte_size - 1); shift >= 0; shift -= 8)
            text += static_cast<char>(value >> shift);
        return text;
    }
};

inline ArtoolkitParameters artoolkit_version_4() {
    // artoolkitX divides the focal lengths in the matrix by the last factor (convParam in its calibration program).
    const double s = 0.97;
    return {.mat = {600 / s, 0, 323.4, 0, 0, 590 / s, 237.6, 0, 0, 0, 1, 0},
            .dist_factor = {0.0992, -0.0921, -0.0019, 0.0013, 600, 590, 323.4, 237.6, s}};
}

} // namespace arhost::test
