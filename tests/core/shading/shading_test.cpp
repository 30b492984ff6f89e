// SPDX-License-Identifier: Apache-2.0
#include <arhost/shading/srgb8.hpp>

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

namespace arhost::shading {
namespace {

constexpr double pi = std::numbers::pi;
constexpr Vec3 up{0, 0, 1};

Vec3 at_degrees(double degrees) {
    const double a = degrees * pi / 180;
    return {std::sin(a), 0, std::cos(a)};
}

TEST(Bsdf, LambertIsTheCosineAndZeroFromBehind) {
    EXPECT_NEAR(lambert(up, at_degrees(60)), 0.5, 1e-12);
    EXPECT_EQ(lambert(up, at_degrees(120)), 0);
}

TEST(Bsdf, PhongIsOneInTheMirrorDirectionAndFallsOffWithTheExponent) {
    EXPECT_NEAR(phong(up, at_degrees(30), at_degrees(-30), 256), 1, 1e-12);
    EXPECT_NEAR(phong(up, at_degrees(30), at_degrees(15), 2), 0.5, 1e-12); // 45° from the mirror direction
    EXPECT_NEAR(phong(up, at_degrees(30), at_degrees(-20), 64), std::pow(std::cos(pi / 18), 64), 1e-12);
}

TEST(Bsdf, PhongIsZeroForLightFromBehind) {
    EXPECT_EQ(phong(up, at_degrees(100), at_degrees(-80), 1), 0);
}

TEST(Bsdf, MirrorReflectsAtTheAngleOfIncidence) {
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
    EXPECT_EQ(code_8bit(shadow_alpha(1, 0, 153 / 255.0, 77 / 255.0)), 153);
    EXPECT_EQ(code_8bit(shadow_alpha(0, 1, 153 / 255.0, 77 / 255.0)), 77);
}

TEST(Alpha, PartsOfALightAreFractions) {
    EXPECT_DOUBLE_EQ(fraction_of(3, 3 + 1), 0.75);
    EXPECT_EQ(fraction_of(0.1 + 0.2, 0.1 + 0.2), 1);
    EXPECT_EQ(fraction_of(0, 0), 0) << "without light there is no shadow";
    EXPECT_EQ(fraction_of(0, 2), 0);
}

// The composite of a shadow and mid-grey video, in linear light relative to that of the video.
double light_of_composite(double alpha) {
    return srgb_decode(0.5 * (1 - alpha)) / srgb_decode(0.5);
}

TEST(Alpha, PartialShadowsHideTheirShareOfLinearLightOverMidGrey) {
    const double opaque = light_of_composite(0.6), translucent = light_of_composite(0.3);
    for (double share = 0; share <= 1; share += 0.05) {
        EXPECT_NEAR(light_of_composite(shadow_alpha(share, 0, 0.6, 0.3)), 1 - share * (1 - opaque), 1e-9) << share;
        EXPECT_NEAR(light_of_composite(shadow_alpha(0, share, 0.6, 0.3)), 1 - share * (1 - translucent), 1e-9);
    }
    EXPECT_NEAR(light_of_composite(shadow_alpha(0.5, 0.25, 0.6, 0.3)),
                1 - 0.5 * (1 - opaque) - 0.25 * (1 - translucent), 1e-9);
    // If the scene lets no light remain in a full shadow, 55 % of the light remain where 45 % are hidden.
    EXPECT_NEAR(light_of_composite(shadow_alpha(0.45, 0, 1, 0.5)), 0.55, 1e-9);
}

TEST(Alpha, OfLightInvertsTheLightUnderAlpha) {
    for (const double alpha : {0.0, 0.1, 0.3, 0.6, 0.99, 1.0})
        EXPECT_NEAR(alpha_of_light(light_under_alpha(alpha)), alpha, 1e-7) << alpha;
    EXPECT_EQ(alpha_of_light(1.001), 0) << "rounding errors do not make alpha negative";
}

TEST(Alpha, ShadowColourCompensatesTheCommonAlphaOverMidGrey) {
    for (const double own : {0.0, 0.2, 0.6}) {
        const double alpha = 0.6, colour = shadow_colour_encoded(own, alpha);
        EXPECT_NEAR(alpha * colour + (1 - alpha) * 0.5, (1 - own) * 0.5, 1e-15);
    }
    EXPECT_EQ(shadow_colour_encoded(0, 0), 0) << "no shadow";
}

TEST(Light, DensityOverAnAreaIntegratesToOneOverItsSolidAngle) {
    // The reciprocal of the density, averaged over the area, is its solid angle; here that of one face of a cube seen
    // from the cube's centre: 4π/6.
    double sum = 0;
    constexpr int n = 200;
    for (int i = 0; i < n * n; ++i) {
        const Vec3 to{(i % n + 0.5) / n * 2 - 1, (i / n + 0.5) / n * 2 - 1, 1};
        sum += 1 / density_over_area(dot(to, to), 4, 1 / length(to)) / (n * n);
    }
    EXPECT_NEAR(sum, 4 * pi / 6, 1e-3);
}

TEST(Light, RaysReachARectangleWithinItsSidesAndFromItsFrontOnly) {
    const Vec3 centre{1, 2, 30}, facing{0, 0, -1}, u{3, 0, 0}, v{0, 5, 0};
    const auto distance = [&](Vec3 to) { return distance_to_rectangle(centre, facing, u, v, normalize(to)); };
    EXPECT_NEAR(distance({1, 2, 30}), length(Vec3{1, 2, 30}), 1e-12);
    EXPECT_NEAR(distance({3.9, 6.9, 30}), length(Vec3{3.9, 6.9, 30}), 1e-12);
    EXPECT_EQ(distance({4.1, 2, 30}), 0);
    EXPECT_EQ(distance({1, -3.1, 30}), 0);
    EXPECT_LE(distance({-1, -2, -30}), 0) << "behind the ray";
    EXPECT_EQ(distance_to_rectangle(centre, -facing, u, v, normalize(centre)), 0) << "the back";
}

TEST(Light, RaysReachTheDiscThatASphereShows) {
    const Vec3 centre{0, 0, 20};
    EXPECT_NEAR(distance_to_disc(centre, 3, {0, 0, 1}), 20, 1e-12);
    EXPECT_NEAR(distance_to_disc(centre, 3, normalize({2.9, 0, 20})), length(Vec3{2.9, 0, 20}), 1e-12);
    EXPECT_EQ(distance_to_disc(centre, 3, normalize({3.1, 0, 20})), 0);
    EXPECT_EQ(distance_to_disc(centre, 3, {0, 0, -1}), 0);
}

TEST(Light, WeightsOfTwoSamplingTechniquesAddUpToOne) {
    EXPECT_DOUBLE_EQ(balance_weight(3, 1), 0.75);
    EXPECT_DOUBLE_EQ(balance_weight(3, 1) + balance_weight(1, 3), 1);
    EXPECT_EQ(balance_weight(3, 0), 1);
    EXPECT_EQ(balance_weight(0, 5), 1) << "only this technique can sample the light";
    EXPECT_DOUBLE_EQ(balance_weight_of_ray(3, 1 / 5.0), balance_weight(5, 3));
    EXPECT_EQ(balance_weight_of_ray(3, 0), 1) << "mirrors and glass";
}

TEST(Light, SpotIsFullInsideTheInnerConeAndDarkOutsideTheOuterCone) {
    EXPECT_EQ(spot_attenuation(1, 0.9, 0.7), 1);
    EXPECT_EQ(spot_attenuation(0.9, 0.9, 0.7), 1);
    EXPECT_NEAR(spot_attenuation(0.8, 0.9, 0.7), 0.5, 1e-12);
    EXPECT_NEAR(spot_attenuation(0.75, 0.9, 0.7), 5.0 / 32, 1e-12); // 3 t² − 2 t³ at a quarter
    EXPECT_EQ(spot_attenuation(0.7, 0.9, 0.7), 0);
    EXPECT_EQ(spot_attenuation(-1, 0.9, 0.7), 0);
    EXPECT_EQ(spot_attenuation(0.81, 0.8, 0.8), 1) << "equal cones give a sharp edge";
    EXPECT_EQ(spot_attenuation(0.79, 0.8, 0.8), 0);
}

TEST(Light, WhiteSurfaceUnderUniformlySampledWhiteSkyIsWhite) {
    // The mean of max(cos, 0) over the sphere is 1/4.
    EXPECT_NEAR(irradiance_of_density(1 / (4 * pi)) / 4, 1, 1e-12);
    EXPECT_TRUE(std::isfinite(irradiance_of_density(0)));
}

TEST(Environment, UpIsTheFirstRowAndMinusZTheCentre) {
    EXPECT_NEAR(equirectangular_v({0, 1, 0}), 0, 1e-12);
    EXPECT_NEAR(equirectangular_v({0, -1, 0}), 1, 1e-12);
    EXPECT_NEAR(equirectangular_v({1, 0, 0}), 0.5, 1e-12);
    EXPECT_NEAR(equirectangular_u({0, 0, -1}), 0.5, 1e-12);
    EXPECT_NEAR(equirectangular_u({1, 0, 0}), 0.75, 1e-12);
    EXPECT_NEAR(equirectangular_u({-1, 0, 0}), 0.25, 1e-12);
    EXPECT_NEAR(angle_from_up(0.5), 1.0 / 3, 1e-12);
    EXPECT_NEAR(angle_from_up(-0.5), 2.0 / 3, 1e-12);
}

TEST(Environment, DirectionsMapBackToTheirCoordinates) {
    for (double v = 0.01; v < 1; v += 0.07)
        for (double u = 0.01; u < 1; u += 0.07) {
            const Vec3 d = equirectangular_direction(u, v);
            EXPECT_NEAR(dot(d, d), 1, 1e-12);
            EXPECT_NEAR(equirectangular_u(d), u, 1e-12);
            EXPECT_NEAR(equirectangular_v(d), v, 1e-7); // less accurate, because an arc cosine is involved
        }
}

TEST(Environment, DensityIsPerSolidAngle) {
    constexpr double h = 1e-5;
    for (double v = 0.01; v < 1; v += 0.07) {
        const Vec3 across = equirectangular_direction(0.3 + h, v) - equirectangular_direction(0.3 - h, v);
        const Vec3 down = equirectangular_direction(0.3, v + h) - equirectangular_direction(0.3, v - h);
        EXPECT_NEAR(equirectangular_density(7, v) * length(cross(across, down)) / (4 * h * h), 7, 1e-6);
    }
    EXPECT_TRUE(std::isfinite(equirectangular_density(1, 0)));
}

TEST(Sampling, AxesFormAnOrthonormalBasis) {
    const auto check = [](Vec3 n) {
        const Vec3 x = tangent_axis(n), y = bitangent_axis(n), z = cross(x, y);
        EXPECT_NEAR(dot(x, x), 1, 1e-12);
        EXPECT_NEAR(dot(y, y), 1, 1e-12);
        EXPECT_NEAR(dot(x, y), 0, 1e-12);
        EXPECT_NEAR(z.x, n.x, 1e-12);
        EXPECT_NEAR(z.y, n.y, 1e-12);
        EXPECT_NEAR(z.z, n.z, 1e-12);
    };
    for (const double z : {-1.0, -1 + 1e-12, -0.999999, -0.5, -1e-9, -0.0, 0.0, 1e-9, 0.3, 0.999999, 1.0})
        for (double turn = 0; turn < 1; turn += 0.13) {
            const double r = std::sqrt(1 - z * z);
            check({r * cosine_of_turn(turn), r * sine_of_turn(turn), z});
        }
}

TEST(Sampling, RectanglesAreCoveredFromCornerToCorner) {
    const Vec3 centre{1, 2, 3}, u{4, 0, 0}, v{0, 0, 5};
    const auto is = [&](double at_u, double at_v, Vec3 expected) {
        const Vec3 error = vector_to_rectangle(centre, u, v, at_u, at_v) - expected;
        EXPECT_EQ(dot(error, error), 0);
    };
    is(0, 0, {-3, 2, -2});
    is(1, 0, {5, 2, -2});
    is(0.5, 0.5, centre);
    is(0.5, 1, {1, 2, 8});
}

TEST(Sampling, SphereDiscFacesTheViewerAndIsSampledUniformly) {
    const Vec3 centre{30, -40, 20};
    Vec3 mean{0, 0, 0};
    double mean_square = 0;
    constexpr int n = 100;
    for (int i = 0; i < n * n; ++i) {
        const Vec3 r = vector_to_disc(centre, 6, (i / n + 0.5) / n, (i % n + 0.5) / n) - centre;
        EXPECT_NEAR(dot(r, centre), 0, 1e-9);
        EXPECT_LE(dot(r, r), 36);
        mean = mean + r * (1.0 / n / n);
        mean_square += dot(r, r) / n / n;
    }
    EXPECT_NEAR(length(mean), 0, 1e-12);
    EXPECT_NEAR(mean_square, 18, 1e-9); // radius² / 2 for a uniform disc
}

TEST(Sampling, HemisphereIsUniform) {
    const Vec3 normal = normalize({0.3, -0.5, 0.7});
    Vec3 mean{0, 0, 0};
    constexpr int n = 100;
    for (int i = 0; i < n * n; ++i) {
        const Vec3 d = hemisphere_direction(normal, (i / n + 0.5) / n, (i % n + 0.5) / n);
        EXPECT_NEAR(length(d), 1, 1e-12);
        EXPECT_GT(dot(d, normal), 0);
        mean = mean + d * (1.0 / n / n);
    }
    EXPECT_NEAR(length(mean - normal * 0.5), 0, 1e-9) << "the mean cosine is ½";
}

TEST(Sampling, FractionOfStepIsLinearAndClamped) {
    EXPECT_NEAR(fraction_of_step(0.35, 0.3, 0.2), 0.25, 1e-12);
    EXPECT_EQ(fraction_of_step(0.3, 0.3, 0.2), 0);
    EXPECT_EQ(fraction_of_step(0.9, 0.3, 0.2), 1);
    EXPECT_EQ(fraction_of_step(0.3, 0.3, 0), 0);
}

TEST(Surface, SecondaryRaysStartAFewUlpsAboveIt) {
    EXPECT_EQ(largest({1, -7, 3}), 7);
    EXPECT_EQ(offset_from_surface({100, -412, 0}, {0, 5, -100}, {0.5, 0, -0.5}, {70, 1e6, 106}), 600.0 / (1 << 19));
}

TEST(Surface, NormalsAreFlippedToTheGivenSide) {
    EXPECT_EQ(facing(up, {1, 0, 0.1}).z, 1);
    EXPECT_EQ(facing(up, {1, 0, -0.1}).z, -1);
    EXPECT_NEAR(shading_normal({0, 3, 4}, up).z, 0.8, 1e-12);
    EXPECT_NEAR(shading_normal({0, 3, -4}, up).z, 0.8, 1e-12) << "on the facet's side";
    EXPECT_NEAR(shading_normal({0, 3, -4}, up).y, -0.6, 1e-12);
    EXPECT_EQ(shading_normal({0, 1e-7, 0}, up).z, 1) << "vertex normals that cancel out";
}

// A triangle whose corners and normals are those of a unit sphere.
TEST(Surface, LiftLeadsFromAFacetTowardsTheCurvedSurface) {
    const Vec3 corners[3] = {normalize({0.2, 0, 1}), normalize({-0.1, 0.2, 1}), normalize({-0.1, -0.2, 1})};
    const Vec3 middle = (corners[0] + corners[1] + corners[2]) * (1.0 / 3);
    const auto lift = [&](double side) {
        Vec3 sum{0, 0, 0};
        for (const Vec3 &corner : corners)
            sum = sum + lift_to_corner(corner - middle, corner * (7 * side)) * (1.0 / 3);
        return sum;
    };
    const double sagitta = 1 - length(middle), height = length(middle + lift(1)) - 1;
    EXPECT_GT(height, 0);
    EXPECT_LT(height, 1.1 * sagitta) << "on the tangent planes, which are as far from the sphere as the facet";
    EXPECT_EQ(length(lift(-1)), 0) << "seen from inside, the sphere is concave";
    EXPECT_EQ(length(lift_to_corner({1, 0, 0}, {0, 0, 0})), 0);
}

TEST(Surface, TangentsPointAlongIncreasingTextureCoordinates) {
    const Vec3 per_u{3, 1, 0}, per_v{-1, 2, 1};
    const auto edge = [&](double u, double v) { return per_u * u + per_v * v; };
    const auto is_along = [](Vec3 a, Vec3 b) {
        const Vec3 error = normalize(a) - normalize(b);
        EXPECT_NEAR(length(error), 0, 1e-12);
    };
    // Corners in either order, and a mirrored texture.
    for (const auto &[u1, v1, u2, v2] :
         {std::array{1.0, 0.0, 0.2, 1.0}, {0.2, 1.0, 1.0, 0.0}, {-1.0, 0.3, 0.5, 2.0}}) {
        is_along(tangent_along_u(edge(u1, v1), edge(u2, v2), u1, u2, v1, v2), per_u);
        is_along(tangent_along_v(edge(u1, v1), edge(u2, v2), u1, u2, v1, v2), per_v);
    }
}

TEST(Surface, NormalMapRedTiltsAlongUAndGreenAgainstV) {
    const Vec3 u{2, 0, 0.5}, v{0, 3, 0}; // u is not orthogonal to the normal
    const auto is = [&](Vec3 texel, Vec3 expected) {
        const Vec3 mapped = perturbed_normal(up, up, u, v, texel, 1);
        EXPECT_NEAR(length(normalize(mapped) - expected), 0, 1e-12);
    };
    is({0.5, 0.5, 1}, up);
    is({0.8, 0.5, 0.9}, {0.6, 0, 0.8});
    is({0.5, 0.8, 0.9}, {0, -0.6, 0.8});
    is({0.5, 0.2, 0.9}, {0, 0.6, 0.8});
    const auto stays = [&](Vec3 normal) { EXPECT_EQ(length(normal - up), 0); };
    stays(perturbed_normal(up, up, u, v, {0.8, 0.5, 0.1}, 1));      // the result would point into the surface
    stays(perturbed_normal(up, up, up * 3, v, {0.8, 0.5, 0.9}, 1)); // u is parallel to the normal
    is({0.8, 0.5, 0.9}, perturbed_normal(up, -up, u, v, {0.8, 0.5, 0.9}, 1)); // the sign of `facet` does not matter
}

TEST(Colour, RadianceIsBoundedFarAboveWhite) {
    EXPECT_EQ(bounded_radiance(40), 40);
    EXPECT_EQ(bounded_radiance(1e6), 100);
    EXPECT_EQ(bounded_radiance(std::numeric_limits<double>::infinity()), 100);
    EXPECT_EQ(bounded_radiance(-1), 0);
}

TEST(Colour, LuminanceIsOneForWhiteAndMostlyGreen) {
    EXPECT_NEAR(luminance({1, 1, 1}), 1, 1e-15);
    EXPECT_EQ(luminance({0, 1, 0}), 0.7152);
    EXPECT_EQ(luminance({1, 0, 0}), 0.2126);
}

TEST(Srgb, EncodesReferenceValuesOfTheStandard) {
    EXPECT_EQ(srgb_encode(0), 0);
    EXPECT_NEAR(srgb_encode(1), 1, 1e-12);
    EXPECT_NEAR(srgb_encode(0.0031308), 0.0404499, 1e-6); // where the two pieces meet
    EXPECT_EQ(srgb8_exact(0.5), 188);
    EXPECT_EQ(srgb8_exact(0.2), 124);
}

TEST(Srgb, DecodeInvertsEncode) {
    for (int code = 0; code <= 255; ++code)
        EXPECT_EQ(srgb8_exact(srgb_decode(code / 255.0)), code);
}

TEST(Srgb8Table, MatchesTheFormulaAtAndBetweenCodeThresholds) {
    const Srgb8Table table = make_srgb8_table();
    int last = 0;
    // Checks every 97th float from below the threshold of code 1 up to 1; these are 1.2 million floats.
    for (std::int32_t bits = std::bit_cast<std::int32_t>(0x1p-14f); bits <= std::bit_cast<std::int32_t>(1.0f);
         bits += 97) {
        const float x = std::bit_cast<float>(bits);
        const int code = table(x);
        ASSERT_EQ(code, srgb8_exact(x)) << x;
        if (code != last) { // check every float since the previous sample
            for (std::int32_t near = bits - 97; near < bits; ++near)
                ASSERT_EQ(table(std::bit_cast<float>(near)), srgb8_exact(std::bit_cast<float>(near)));
            ASSERT_EQ(code, last + 1);
            last = code;
        }
    }
    EXPECT_EQ(last, 255);
}

TEST(Srgb8Table, ClampsValuesOutsideZeroToOne) {
    const Srgb8Table table = make_srgb8_table();
    EXPECT_EQ(table(-1.0f), 0);
    EXPECT_EQ(table(0.0f), 0);
    EXPECT_EQ(table(7.0f), 255);
    EXPECT_EQ(table(std::numeric_limits<float>::infinity()), 255);
    EXPECT_EQ(table(std::numeric_limits<float>::quiet_NaN()), 0);
}

} // namespace
} // namespace arhost::shading
