// SPDX-License-Identifier: Apache-2.0
#include "pixels/formulas.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <tuple>

namespace arhost {
namespace {

// Converts with the matrices of ITU-R BT.601-7 and BT.709-6 in floating point, derived from the luma weights.
struct Exact {
    double kr, kb;
    bool limited;
    std::array<double, 3> bgr(int y, int u, int v) const {
        const double luma = limited ? (y - 16) * 255.0 / 219 : y;
        const double scale = limited ? 255.0 / 224 : 1;
        const double cb = (u - 128) * scale, cr = (v - 128) * scale;
        const double r = luma + 2 * (1 - kr) * cr, b = luma + 2 * (1 - kb) * cb;
        // Solves Y = kr·R + kg·G + kb·B for G.
        const double g = (luma - kr * r - kb * b) / (1 - kr - kb);
        return {b, g, r};
    }
};

class EveryYuv : public testing::TestWithParam<std::tuple<double, double, bool>> {}; // kr, kb, limited

} // namespace

TEST(Blended, MatchesEquation36RoundedToNearestForAllInputs) {
    std::size_t wrong = 0;
    for (int a = 0; a < 256; ++a)
        for (int b = 0; b < 256; ++b)
            for (int alpha = 0; alpha < 256; ++alpha)
                wrong += std::abs(255 * blended(a, b, alpha) - (a * (255 - alpha) + b * alpha)) > 127;
    EXPECT_EQ(wrong, 0u);
}

TEST(Blended, GivesTheHandComputedValues) {
    EXPECT_EQ(blended(200, 100, 0), 200);
    EXPECT_EQ(blended(200, 100, 255), 100);
    EXPECT_EQ(blended(200, 100, 128), 150); // 38200 / 255 = 149.8
    EXPECT_EQ(blended(255, 0, 153), 102);   // black with alpha 0.6 (a shadow) over white
    EXPECT_EQ(blended(255, 0, 77), 178);
}

TEST_P(EveryYuv, IsWithinOneOfTheExactValue) {
    const auto [kr, kb, limited] = GetParam();
    const Exact standard{kr, kb, limited};
    const YuvMatrix matrix = yuv_matrix(kr, kb, limited);
    std::size_t too_far = 0, not_nearest = 0;
    for (int u = 0; u < 256; ++u)
        for (int v = 0; v < 256; ++v)
            for (int y = 0; y < 256; ++y) {
                const auto exact = standard.bgr(y, u, v);
                const Bgr got = bgr_from_yuv(matrix, y, u, v);
                const std::array<int, 3> bytes = {got.b, got.g, got.r};
                for (std::size_t c = 0; c < 3; ++c) {
                    const double error = std::abs(std::clamp(exact[c], 0.0, 255.0) - bytes[c]);
                    too_far += error > 1;
                    not_nearest += error > 0.5 + 1e-9;
                }
            }
    EXPECT_EQ(too_far, 0u);
    EXPECT_LT(double(not_nearest), 0.01 * 3 * (1 << 24)); // less than 1 % of all values are not the nearest integer
}
INSTANTIATE_TEST_SUITE_P(Matrices, EveryYuv,
                         testing::Values(std::tuple(0.299, 0.114, true), std::tuple(0.299, 0.114, false),
                                         std::tuple(0.2126, 0.0722, true), std::tuple(0.2126, 0.0722, false)));

TEST(Yuv, GivesTheColoursOfTheStandards) {
    const auto is = [](const Bgr &got, int r, int g, int b) {
        return std::abs(got.r - r) <= 1 && std::abs(got.g - g) <= 1 && std::abs(got.b - b) <= 1;
    };
    const YuvMatrix bt601 = yuv_matrix(0.299, 0.114, true), bt709 = yuv_matrix(0.2126, 0.0722, true);
    EXPECT_TRUE(is(bgr_from_yuv(bt601, 16, 128, 128), 0, 0, 0));
    EXPECT_TRUE(is(bgr_from_yuv(bt601, 235, 128, 128), 255, 255, 255));
    EXPECT_TRUE(is(bgr_from_yuv(bt601, 81, 90, 240), 255, 0, 0));
    EXPECT_TRUE(is(bgr_from_yuv(bt601, 41, 240, 110), 0, 0, 255));
    EXPECT_TRUE(is(bgr_from_yuv(bt709, 63, 102, 240), 255, 0, 0));
    EXPECT_TRUE(is(bgr_from_yuv(bt709, 32, 240, 118), 0, 0, 255));
    EXPECT_TRUE(is(bgr_from_yuv(yuv_matrix(0.299, 0.114, false), 76, 85, 255), 254, 0, 0));
}

TEST(FullRange, IsRoundedToNearestAndClamped) {
    for (int y = 0; y < 256; ++y)
        EXPECT_EQ(full_range(y), std::lround((std::clamp(y, 16, 235) - 16) * 255.0 / 219)) << y;
}

} // namespace arhost
