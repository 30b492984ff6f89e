// SPDX-License-Identifier: Apache-2.0
#include <arhost/shading/srgb8.hpp>

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>

namespace arhost::shading {
namespace {

constexpr Vec3 up{0, 0, 1};

Vec3 at_degrees(double degrees) {
    const double a = degrees * 3.14159265358979323846 / 180;
    return {std::sin(a), 0, std::cos(a)};
}

TEST(Bsdf, LambertIsTheCosineAndNothingFromBehind) {
    EXPECT_NEAR(lambert(up, at_degrees(60)), 0.5, 1e-12);
    EXPECT_EQ(lambert(up, at_degrees(120)), 0);
}

TEST(Bsdf, PhongIsOneInTheMirrorDirectionAndFallsOffWithTheExponent) {
    EXPECT_NEAR(phong(up, at_degrees(30), at_degrees(-30), 256), 1, 1e-12);
    EXPECT_NEAR(phong(up, at_degrees(30), at_degrees(15), 2), 0.5, 1e-12); // 45° off
    EXPECT_NEAR(phong(up, at_degrees(30), at_degrees(-20), 64), std::pow(std::cos(3.14159265358979323846 / 18), 64),
                1e-12);
}

TEST(Bsdf, PhongGivesNothingFromBehindTheSurface) {
    EXPECT_EQ(phong(up, at_degrees(100), at_degrees(-80), 1), 0);
}

TEST(Bsdf, AMirrorSendsTheRayBackUnderTheSameAngle) {
    const Vec3 reflected = mirror_direction({0.6, 0, -0.8}, up);
    EXPECT_DOUBLE_EQ(reflected.x, 0.6);
    EXPECT_DOUBLE_EQ(reflected.z, 0.8);
}

TEST(Light, FallsOffWithTheSquareOfTheDistanceOrNotAtAll) {
    EXPECT_DOUBLE_EQ(point_light_falloff(true, 100.0 * 100.0), 1e-4);
    EXPECT_EQ(point_light_falloff(false, 100.0 * 100.0), 1);
    EXPECT_TRUE(std::isfinite(point_light_falloff(true, 0)));
}

TEST(Alpha, ClassesGiveTheirCodes) {
    EXPECT_EQ(code_8bit(shadow_alpha(0, 0, 0.6, 0.3)), 0);
    EXPECT_EQ(code_8bit(shadow_alpha(1, 0, 0.6f, 0.3f)), 153);
    EXPECT_EQ(code_8bit(shadow_alpha(0, 1, 0.6f, 0.3f)), 77);
    EXPECT_EQ(shadow_alpha(0, 1, 0.6f, 0.3f), double{0.3f}) << "to the last bit: 76.5 is rounded";
}

TEST(Alpha, SeveralLightsAreWeighedByTheirIrradiance) {
    EXPECT_DOUBLE_EQ(share_of_light(3, 3 + 1), 0.75);
    EXPECT_EQ(share_of_light(0.1 + 0.2, 0.1 + 0.2), 1);
    EXPECT_EQ(share_of_light(0, 0), 0) << "no light, no shadow";
    EXPECT_DOUBLE_EQ(shadow_alpha(0.5, 0.25, 0.6, 0.3), 0.375);
}

TEST(Srgb, EncodesTheStandardsLandmarks) {
    EXPECT_EQ(srgb_encode(0), 0);
    EXPECT_NEAR(srgb_encode(1), 1, 1e-12);
    EXPECT_NEAR(srgb_encode(0.0031308), 0.0404499, 1e-6); // where the two pieces meet
    EXPECT_EQ(srgb8_exact(0.5), 188);
    EXPECT_EQ(srgb8_exact(0.2), 124);
}

TEST(Srgb, DecodeUndoesEncode) {
    for (int code = 0; code <= 255; ++code)
        EXPECT_EQ(srgb8_exact(srgb_decode(code / 255.0)), code);
}

TEST(Srgb8Table, EqualsTheFormulaAtEachCodesEdgeAndBetween) {
    const Srgb8Table table = make_srgb8_table();
    int last = 0;
    // Every 97th float from below the first code's edge to 1, 1.2 million of them.
    for (std::int32_t bits = std::bit_cast<std::int32_t>(0x1p-14f); bits <= std::bit_cast<std::int32_t>(1.0f);
         bits += 97) {
        const float x = std::bit_cast<float>(bits);
        const int code = table(x);
        ASSERT_EQ(code, srgb8_exact(x)) << x;
        if (code != last) { // all floats round the edge that has just been passed
            for (std::int32_t near = bits - 97; near < bits; ++near)
                ASSERT_EQ(table(std::bit_cast<float>(near)), srgb8_exact(std::bit_cast<float>(near)));
            ASSERT_EQ(code, last + 1);
            last = code;
        }
    }
    EXPECT_EQ(last, 255);
}

TEST(Srgb8Table, ClampsWhatIsNotBetweenBlackAndWhite) {
    const Srgb8Table table = make_srgb8_table();
    EXPECT_EQ(table(-1.0f), 0);
    EXPECT_EQ(table(0.0f), 0);
    EXPECT_EQ(table(7.0f), 255);
    EXPECT_EQ(table(std::numeric_limits<float>::infinity()), 255);
    EXPECT_EQ(table(std::numeric_limits<float>::quiet_NaN()), 0);
}

} // namespace
} // namespace arhost::shading
