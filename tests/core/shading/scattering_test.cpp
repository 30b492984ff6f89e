// SPDX-License-Identifier: Apache-2.0
//
// Compares Fresnel terms, glass and microfacets with published values and numerical integrals.
#include <arhost/shading/scalar.hpp>

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <string>

namespace arhost::shading {
namespace {

constexpr double pi = std::numbers::pi;
constexpr Vec3 up{0, 0, 1};

Vec3 direction(double theta, double phi) {
    return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}

// Integrates f over the directions with z > 0 with the midpoint rule; the steps are finest near the pole.
template <class F> double integral_over_hemisphere(F f, int rows = 600, int columns = 300) {
    double sum = 0;
    for (int row = 0; row < rows; ++row) {
        const double x = (row + 0.5) / rows, theta = pi / 2 * x * x, step = pi * x / rows;
        for (int column = 0; column < columns; ++column) {
            const double phi = 2 * pi * (column + 0.5) / columns;
            sum += f(direction(theta, phi)) * std::sin(theta) * step * 2 * pi / columns;
        }
    }
    return sum;
}

// Returns the mean of f(u, v) over the unit square.
template <class F> double mean_over_square(F f, int n = 500) {
    double sum = 0;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j)
            sum += f((i + 0.5) / n, (j + 0.5) / n);
    return sum / n / n;
}

void expect_near(Vec3 a, Vec3 b, double tolerance) {
    EXPECT_NEAR(a.x, b.x, tolerance);
    EXPECT_NEAR(a.y, b.y, tolerance);
    EXPECT_NEAR(a.z, b.z, tolerance);
}

} // namespace

TEST(Schlick, RisesFromNormalReflectanceToOneAtGrazingIncidence) {
    const Vec3 metal{0.04, 0.5, 1};
    expect_near(schlick(metal, 1), metal, 0);
    expect_near(schlick(metal, 0), {1, 1, 1}, 0);
    expect_near(schlick(metal, 0.5), {0.04 + 0.96 / 32, 0.5 + 0.5 / 32, 1}, 1e-15); // eq. 15
    expect_near(schlick(metal, 1.5), metal, 0);
    expect_near(schlick_between(metal, 0.25, 0), {0.25, 0.25, 0.25}, 0);
    expect_near(schlick(metal, -0.5), {1, 1, 1}, 0);
}

TEST(Glass, ReflectanceFollowsTheExponentWithinTheLimits) {
    EXPECT_NEAR(glass_reflectance(0.5, 5, 0.04, 1), 0.04 + 0.96 / 32, 1e-15);
    EXPECT_NEAR(glass_reflectance(0.5, 3, 0.1, 1), 0.1 + 0.9 / 8, 1e-15);
    EXPECT_NEAR(glass_reflectance(0.75, 0.5, 0, 1), 0.5, 1e-15);
    EXPECT_EQ(glass_reflectance(0.5, 3, 0.1, 0.2), 0.2) << "the maximum";
    EXPECT_NEAR(glass_reflectance(1, 3, 0.1, 0.2), 0.1, 1e-15) << "the minimum";
    EXPECT_EQ(glass_reflectance(0, 3, 0.1, 1), 1);
    EXPECT_EQ(glass_reflectance(0.3, 3, 0, 0), 0);
}

TEST(Glass, RefractsBySnellsLaw) {
    for (const double ratio : {1 / 1.5, 1.0, 1.2})
        for (const double angle : {0.0, 0.3, 0.7, 0.98}) {
            const Vec3 incident{std::sin(angle), 0, -std::cos(angle)};
            const double cosine = std::cos(angle), squared = refracted_cosine_squared(cosine, ratio);
            const Vec3 refracted = refracted_direction(incident, up, ratio, cosine, std::sqrt(squared));
            expect_near(refracted, {ratio * std::sin(angle), 0, -std::sqrt(squared)}, 1e-15);
            EXPECT_NEAR(dot(refracted, refracted), 1, 1e-14);
        }
}

TEST(Glass, ReflectsTotallyBeyondTheCriticalAngle) {
    const double critical = std::asin(1 / 1.5);
    EXPECT_GT(refracted_cosine_squared(std::cos(critical - 1e-6), 1.5), 0);
    EXPECT_LT(refracted_cosine_squared(std::cos(critical + 1e-6), 1.5), 0);
    const auto reflectance = [](double angle) {
        return glass_reflected_fraction(true, std::cos(angle), refracted_cosine_squared(std::cos(angle), 1.5), 5,
                                        0.04, 0.7);
    };
    EXPECT_LE(reflectance(critical - 1e-6), 0.7);
    EXPECT_EQ(reflectance(critical + 1e-6), 1) << "total reflection ignores the maximum";
}

TEST(Glass, ReflectanceIsTheSameFromInsideAndOutside) {
    for (const double angle : {0.0, 0.4, 1.0, 1.5}) {
        const double outside = std::cos(angle), squared = refracted_cosine_squared(outside, 1 / 1.5);
        const double inside = std::sqrt(squared);
        EXPECT_NEAR(glass_reflected_fraction(false, outside, squared, 4, 0.05, 1),
                    glass_reflected_fraction(true, inside, refracted_cosine_squared(inside, 1.5), 4, 0.05, 1), 1e-12);
    }
}

TEST(Glass, AbsorbsByBouguersLaw) {
    expect_near(bouguer({0.01, 0.2, 0}, 50), {std::exp(-0.5), std::exp(-10), 1}, 1e-14);
    expect_near(bouguer({1, 2, 3}, 0), {1, 1, 1}, 0);
}

TEST(Glass, ShadowIsTheAttenuationAtNormalIncidenceAndBlackAtGrazing) {
    const Vec3 attenuation{0.4, 0.8, 1};
    expect_near(glass_shadow(attenuation, 1), attenuation, 1e-15);
    expect_near(glass_shadow(attenuation, 0), {0, 0, 0}, 1e-15);
    expect_near(glass_shadow(attenuation, 0.5), {0.4 * 31 / 32, 0.8 * 31 / 32, 31.0 / 32}, 1e-15);
}

TEST(InterpolatedNormals, ReflectNoRayIntoTheFacet) {
    const Vec3 incident{0.6, 0, -0.8}, tilted{0.6, 0, 0.8};
    expect_near(mirror_direction_off_facet(incident, up, up), {0.6, 0, 0.8}, 1e-15);
    expect_near(mirror_direction_off_facet(incident, tilted, {1, 0, 0}), mirror_direction(incident, tilted), 0);
    expect_near(mirror_direction_off_facet(incident, -tilted, {-1, 0, 0}), {-0.6, 0, -0.8}, 1e-15);
}

TEST(MetallicRoughness, MetalsReflectTheirColourAndDielectricsFourPercent) {
    const Vec3 base{0.5, 0.25, 1};
    const Vec3 dielectric{0.04, 0.04, 0.04};
    EXPECT_NEAR(normal_reflectance(1.5), 0.04, 1e-15);
    expect_near(metallic_reflectance(dielectric, base, 0), dielectric, 0);
    expect_near(metallic_reflectance(dielectric, base, 1), base, 0);
    expect_near(metallic_reflectance(dielectric, base, 0.25), {0.03 + 0.125, 0.03 + 0.0625, 0.28}, 1e-15);
    expect_near(metallic_diffuse(base, 0), base, 0);
    expect_near(metallic_diffuse(base, 1), {0, 0, 0}, 0);
    EXPECT_EQ(ggx_alpha(0.5), 0.25);
    EXPECT_EQ(ggx_alpha(0), 0.001);
}

TEST(Ggx, ProjectedMicrofacetAreaIntegratesToOne) {
    for (const double alpha : {0.05, 0.3, 1.0})
        EXPECT_NEAR(integral_over_hemisphere([&](Vec3 n) { return ggx_distribution(n.z, alpha) * n.z; }), 1, 1e-3)
            << alpha;
}

TEST(Ggx, VisibleMicrofacetAreaIsTheProjectedSurfaceArea) {
    for (const double alpha : {0.1, 0.3, 1.0})
        for (const double theta : {0.0, 0.8, 1.4}) {
            const Vec3 eye = direction(theta, 0.5);
            const double seen = integral_over_hemisphere(
                [&](Vec3 n) { return ggx_distribution(n.z, alpha) * std::max(dot(eye, n), 0.0); });
            EXPECT_NEAR(ggx_masking(eye.z, alpha) * seen, eye.z, 2e-3) << alpha << " " << theta;
        }
}

// Compares a histogram of sampled normals with the density. The hemisphere has 8 × 8 cells, equally spaced in θ and
// φ.
TEST(Ggx, VisibleNormalsAreSampledByTheirDensity) {
    constexpr int cells = 8, steps = 60; // per axis: number of cells; integration steps in each cell
    for (const double alpha : {0.2, 0.5, 1.0})
        for (const double theta : {0.0, 0.6, 1.3}) {
            const Vec3 eye = direction(theta, 2.0);
            std::array<double, cells * cells> chosen{};
            mean_over_square([&](double u, double v) {
                const Vec3 n = ggx_visible_normal(eye, alpha, alpha, u, v);
                EXPECT_NEAR(dot(n, n), 1, 1e-12);
                const double t = std::acos(n.z) / (pi / 2), p = std::atan2(n.y, n.x) / (2 * pi) + 0.5;
                const int row = std::min(static_cast<int>(t * cells), cells - 1);
                chosen.at(static_cast<std::size_t>(row * cells + std::min(static_cast<int>(p * cells), cells - 1))) +=
                    1.0 / (500 * 500);
                return 0.0;
            });
            for (int row = 0; row < cells; ++row)
                for (int column = 0; column < cells; ++column) {
                    double expected = 0;
                    for (int i = 0; i < steps * steps; ++i) {
                        const double t = (row + (i / steps + 0.5) / steps) / cells * pi / 2;
                        const double p = ((column + (i % steps + 0.5) / steps) / cells - 0.5) * 2 * pi;
                        const Vec3 n = direction(t, p);
                        expected += ggx_masking(eye.z, alpha) * std::max(dot(eye, n), 0.0) / eye.z *
                                    ggx_distribution(n.z, alpha) * std::sin(t) * pi * pi / std::pow(cells * steps, 2);
                    }
                    ASSERT_NEAR(chosen.at(static_cast<std::size_t>(row * cells + column)), expected, 2e-3)
                        << alpha << " " << theta << " " << row << " " << column;
                }
        }
}

// White furnace test: with perfectly reflecting microfacets, light may be lost by masking, but must not be gained.
TEST(Ggx, LampsAndSampledRaysReflectTheSameLight) {
    for (const double alpha : {0.1, 0.3, 0.7, 1.0})
        for (const double theta : {0.0, 0.7, 1.2, 1.4}) {
            const std::string where = std::to_string(alpha) + " " + std::to_string(theta);
            const Vec3 eye = direction(theta, 0);
            const double by_lamps = integral_over_hemisphere(
                [&](Vec3 light) { return ggx_lobe(light.z, eye.z, normalize(eye + light).z, alpha) / pi; });
            const double by_rays = mean_over_square([&](double u, double v) {
                const Vec3 light = mirror_direction(-eye, ggx_half_vector(up, eye, alpha, u, v));
                return light.z > 0 ? ggx_masking(light.z, alpha) : 0;
            });
            EXPECT_LE(by_lamps, 1.001) << where;
            EXPECT_NEAR(by_rays, by_lamps, 2e-3) << where;
            EXPECT_GT(by_rays, 0.3) << where;
        }
}

TEST(Ggx, LobeIsTheDensityTimesTheMaskingOfTheLight) {
    for (const double alpha : {0.1, 0.5, 1.0})
        for (const double theta : {0.1, 0.9, 1.5}) {
            const Vec3 eye = direction(theta, 0), light = direction(0.7, 2.5);
            const double half = normalize(eye + light).z;
            EXPECT_NEAR(ggx_reflection_density(eye.z, half, alpha) * ggx_masking(light.z, alpha) * pi,
                        ggx_lobe(light.z, eye.z, half, alpha), 1e-9);
        }
}

TEST(Ggx, HalfVectorsRotateWithTheSurface) {
    const Vec3 normal = normalize({0.3, -0.5, -0.7}), x = tangent_axis(normal), y = bitangent_axis(normal);
    const Vec3 eye = direction(0.6, 1);
    const Vec3 turned_eye = x * eye.x + y * eye.y + normal * eye.z;
    const Vec3 n = ggx_visible_normal(eye, 0.4, 0.4, 0.3, 0.8);
    expect_near(ggx_half_vector(normal, turned_eye, 0.4, 0.3, 0.8), x * n.x + y * n.y + normal * n.z, 1e-14);
}

TEST(AnisotropicGgx, EqualsGgxIfBothAlphasAreEqual) {
    const Vec3 eye = direction(0.9, 0.4), light = direction(0.5, 2), half = normalize(eye + light);
    EXPECT_NEAR(anisotropic_lobe(light, eye, half, 0.3, 0.3), ggx_lobe(light.z, eye.z, half.z, 0.3), 1e-12);
    EXPECT_NEAR(anisotropic_reflection_density(eye, half, 0.3, 0.3), ggx_reflection_density(eye.z, half.z, 0.3),
                1e-12);
}

TEST(AnisotropicGgx, LampsAndSampledRaysReflectTheSameLight) {
    const Vec3 x{1, 0, 0}, y{0, 1, 0};
    for (const auto &[alpha_x, alpha_y] : {std::pair(0.7, 0.2), std::pair(0.2, 1.0)})
        for (const double theta : {0.2, 0.9, 1.3}) {
            const Vec3 eye = direction(theta, 0.7);
            const double by_lamps = integral_over_hemisphere([&](Vec3 light) {
                return anisotropic_lobe(light, eye, normalize(eye + light), alpha_x, alpha_y) / pi;
            });
            const double by_rays = mean_over_square([&](double u, double v) {
                const Vec3 half = anisotropic_half_vector(x, y, up, eye, alpha_x, alpha_y, u, v),
                           light = mirror_direction(-eye, half);
                return light.z > 0 ? anisotropic_lobe(light, eye, half, alpha_x, alpha_y) / pi /
                                         anisotropic_reflection_density(eye, half, alpha_x, alpha_y)
                                   : 0;
            });
            EXPECT_NEAR(by_rays, by_lamps, 3e-3) << alpha_x << " " << theta;
            EXPECT_LE(by_lamps, 1.001) << alpha_x << " " << theta;
        }
}

TEST(Sheen, AlbedoIsTheIntegralOfTheLobe) {
    for (const double roughness : {0.2, 0.35, 0.6, 1.0})
        for (const double theta : {0.0, 0.6, 1.0, 1.3, 1.5}) {
            const Vec3 eye = direction(theta, 0);
            EXPECT_NEAR(sheen_albedo(eye.z, roughness), integral_over_hemisphere([&](Vec3 light) {
                            return sheen_lobe(light.z, eye.z, normalize(eye + light).z, roughness * roughness) / pi;
                        }),
                        0.011)
                << roughness << " " << theta;
        }
    EXPECT_EQ(sheen_roughness_of(0.1), 0.2);
}

TEST(ThinFilm, OfNoThicknessHasNoEffect) {
    const Vec3 f0{0.04, 0.3, 0.9};
    expect_near(film_reflectance(f0, 1.8, 0, 0.4), schlick(f0, 0.4), 2e-3);
    EXPECT_NEAR(schlick_inverse(schlick(f0, 0.4).y, 1, 0.4), 0.3, 1e-12);
}

// Integrates Airy's formula for normal incidence over the spectrum, with approximations of the CIE 1931 colour
// matching functions (C. Wyman et al., Simple Analytic Approximations to the CIE XYZ Color Matching Functions, JCGT
// 2(2), 2013).
TEST(ThinFilm, HasTheColoursOfInterference) {
    const auto lobe = [](double x, double mean, double below, double above) {
        const double t = (x - mean) / (x < mean ? below : above);
        return std::exp(-t * t / 2);
    };
    for (const double nm : {150.0, 280.0, 400.0, 650.0}) {
        const double film = 1.8, base = 1.5;
        const double r1 = (1 - film) / (1 + film), r2 = (film - base) / (film + base);
        Vec3 xyz{0, 0, 0}, white{0, 0, 0};
        for (double wave = 380; wave <= 780; wave += 1) {
            const double turn = std::cos(4 * pi * film * nm / wave);
            const double reflected =
                (r1 * r1 + r2 * r2 + 2 * r1 * r2 * turn) / (1 + r1 * r1 * r2 * r2 + 2 * r1 * r2 * turn);
            const Vec3 observer{1.056 * lobe(wave, 599.8, 37.9, 31) + 0.362 * lobe(wave, 442, 16, 26.7) -
                                    0.065 * lobe(wave, 501.1, 20.4, 26.2),
                                0.821 * lobe(wave, 568.8, 46.9, 40.5) + 0.286 * lobe(wave, 530.9, 16.3, 31.1),
                                1.217 * lobe(wave, 437, 11.8, 36) + 0.681 * lobe(wave, 459, 26, 13.8)};
            xyz = xyz + observer * reflected;
            white = white + observer;
        }
        const double luminance_of_film = luminance(film_reflectance({0.04, 0.04, 0.04}, film, nm, 1));
        EXPECT_NEAR(luminance_of_film, xyz.y / white.y, 0.02) << nm;
    }
}

TEST(DielectricReflectance, IsFresnels) {
    const double ratio = 1 / 1.5;
    EXPECT_NEAR(dielectric_reflectance(1, refracted_cosine_squared(1, ratio), ratio), 0.04, 1e-12);
    const double brewster = std::cos(std::atan(1.5)),
                 refracted = std::sqrt(refracted_cosine_squared(brewster, ratio));
    const double perpendicular = (ratio * brewster - refracted) / (ratio * brewster + refracted);
    EXPECT_NEAR(dielectric_reflectance(brewster, refracted * refracted, ratio), perpendicular * perpendicular / 2,
                1e-12);
    EXPECT_EQ(dielectric_reflectance(0.5, refracted_cosine_squared(0.5, 1.5), 1.5), 1); // total internal reflection
}

TEST(ConeDirection, IsInsideTheCone) {
    const Vec3 axis = normalize(Vec3{1, 2, 3});
    for (const double u : {0.0, 0.3, 0.999}) {
        const Vec3 d = cone_direction(axis, 0.1, u, 0.7);
        EXPECT_NEAR(length(d), 1, 1e-12);
        EXPECT_NEAR(dot(d, axis), 1 - 0.1 * u, 1e-12);
    }
}

TEST(CosineDirection, HasADensityProportionalToTheCosine) {
    const Vec3 normal = normalize(Vec3{-1, 0.5, 2});
    double sum = 0;
    constexpr int count = 1000;
    for (int i = 0; i < count; ++i)
        sum += dot(cosine_direction(normal, (i + 0.5) / count, 0.3), normal);
    EXPECT_NEAR(sum / count, 2.0 / 3, 1e-5);
}

} // namespace arhost::shading
