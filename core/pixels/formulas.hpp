// SPDX-License-Identifier: Apache-2.0
//
// Integer pixel arithmetic. The SIMD kernels in rows.cpp must produce the same bytes.
#pragma once

#include <arhost/frame.h>

#include <algorithm>
#include <cstdint>

namespace arhost {

struct Bgr {
    std::uint8_t b, g, r;
};

// Blends B over A (equation 3.6 of the dissertation). Rounding has no ties, because 255 is odd.
constexpr std::uint8_t blended(int a, int b, int alpha) {
    return static_cast<std::uint8_t>((a * (255 - alpha) + b * alpha + 127) / 255);
}

// Factors for converting Y'CbCr to R'G'B'. A factor b is used as (a·b + 2^14) >> 15, where a is y·2^7 for luma, and
// u·2^8 or v·2^8 for chroma. The results are in units of 1/64 and fit in 16 bits.
struct YuvMatrix {
    std::int16_t y_offset;
    std::int16_t yy, rv, gu, gv, bu;
};

// Computes the factors. `kr` and `kb` are the luma weights of red and blue; ITU-R BT.601-7 §2.5 and BT.709-6 §3
// differ only in these weights.
constexpr YuvMatrix yuv_matrix(double kr, double kb, bool limited) {
    const auto rounded = [](double x) { return static_cast<std::int16_t>(x + 0.5); };
    const double kg = 1 - kr - kb;
    const double luma = limited ? 255.0 / 219 : 1, chroma = 2 * (limited ? 255.0 / 224 : 1) * (1 << 13);
    return {static_cast<std::int16_t>(limited ? 16 : 0),
            rounded(luma * (1 << 14)),
            rounded(chroma * (1 - kr)),
            rounded(chroma * (1 - kb) * kb / kg),
            rounded(chroma * (1 - kr) * kr / kg),
            rounded(chroma * (1 - kb))};
}

constexpr YuvMatrix yuv_matrix(const arhost_frame_format &format) {
    const bool limited = format.yuv_range != ARHOST_YUV_RANGE_FULL;
    return format.yuv_matrix == ARHOST_YUV_MATRIX_BT709 ? yuv_matrix(0.2126, 0.0722, limited)
                                                        : yuv_matrix(0.299, 0.114, limited);
}

constexpr Bgr bgr_from_yuv(const YuvMatrix &m, int y, int u, int v) {
    const auto product = [](int a, int b) { return (a * b + (1 << 14)) >> 15; };
    const auto byte = [](int x) { return static_cast<std::uint8_t>(std::clamp((x + 32) >> 6, 0, 255)); };
    const int luma = product((y - m.y_offset) * 128, m.yy), cu = (u - 128) * 256, cv = (v - 128) * 256;
    return {byte(luma + product(cu, m.bu)), byte(luma - product(cu, m.gu) - product(cv, m.gv)),
            byte(luma + product(cv, m.rv))};
}

// 0.299, 0.587 and 0.114 (ITU-R BT.601-7 §2.5.1) in units of 1/65536. The sum is 65536.
constexpr std::uint16_t red_weight = 19595, green_weight = 38470, blue_weight = 7471;
// Half a grey level, plus the mean total error of the three truncations.
constexpr std::uint16_t grey_rounding = 129;

constexpr std::uint8_t grey_from_rgb(unsigned r, unsigned g, unsigned b) {
    const auto part = [](unsigned value, unsigned weight) { return (value << 8) * weight >> 16; };
    return static_cast<std::uint8_t>(
        (part(r, red_weight) + part(g, green_weight) + part(b, blue_weight) + grey_rounding) >> 8);
}

// Expands limited-range luma (16 to 235) to 0 to 255, rounded to nearest.
constexpr std::uint8_t full_range(int y) {
    return static_cast<std::uint8_t>(((std::clamp(y, 16, 235) - 16) * 255 + 109) / 219);
}
// Gain for t = y − 16: ((t·2^8·gain >> 16) + 64) >> 7 equals full_range(y) for t = 0 to 219.
constexpr std::uint16_t full_range_gain = 38155;

} // namespace arhost
