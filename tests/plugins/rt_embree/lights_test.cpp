// SPDX-License-Identifier: Apache-2.0
//
// For each type of light, compares the brightness of a lit white plane with the analytic value.
#include "tracer.hpp"

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace arhost::test {
namespace {

Picture over_a_plane(const arhost_light &lamp, const Options &options = {}) {
    SceneBuilder builder({.ambient = glm::vec3(0)});
    builder.add_mesh("plane", square(200), diffuse(1, 1, 1));
    builder.add_light(lamp);
    return Tracer(std::move(builder), options).render(from_above());
}

void expect_irradiance(const Picture &picture, const std::function<double(glm::dvec3)> &expected,
                       double tolerance = 1e-4) {
    for (int y = 0; y < 150; y += 5)
        for (int x = 0; x < 200; x += 5)
            ASSERT_TRUE(is_code_of(picture.at(x, y)[0], expected(on_the_floor(x, y)), tolerance)) << x << " " << y;
}

// Renders a ball over a catcher and returns the number of pixels for each alpha.
std::map<int, int> shadow_of_a_ball(const arhost_light &lamp) {
    SceneBuilder builder;
    builder.add_mesh("floor", square(80), diffuse(1, 1, 1), ARHOST_ROLE_CATCHER);
    builder.add_ball("ball", {0, 0, 25, 12}, diffuse(1, 0, 0));
    builder.add_light(lamp);
    return Tracer(std::move(builder), {{"light_samples", "64"}}).render(from_the_side()).alphas();
}

} // namespace

TEST(DirectionalLight, IsUniform) {
    arhost_light lamp = placed(ARHOST_LIGHT_DIRECTIONAL, {0, 0, 0}, 0.8f);
    set3(lamp.direction, 0.6f, 0, -0.8f);
    expect_irradiance(over_a_plane(lamp), [](glm::dvec3) { return 0.8 * 0.8; });
}

TEST(DirectionalLight, CastsHardShadows) {
    const auto near = shadow_of_a_ball(sun());
    EXPECT_EQ(near.size(), 3u);
    EXPECT_GT(near.at(153), 100);
}

TEST(SpotLight, LightsOnlyItsCone) {
    arhost_light spot = placed(ARHOST_LIGHT_SPOT, {30, -20, 90}, 5000, ARHOST_FALLOFF_INVERSE_SQUARE);
    const glm::dvec3 axis = glm::normalize(glm::dvec3(-0.3, 0.2, -0.9));
    set3(spot.direction, static_cast<float>(axis.x), static_cast<float>(axis.y), static_cast<float>(axis.z));
    spot.cosine_inner = 0.9f;
    spot.cosine_outer = 0.8f;
    expect_irradiance(
        over_a_plane(spot),
        [&](glm::dvec3 p) {
            const glm::dvec3 to_point = p - glm::dvec3(30, -20, 90);
            const double d = glm::length(to_point), cosine = glm::dot(to_point / d, axis);
            const double t = std::clamp((cosine - double{0.8f}) / (double{0.9f} - double{0.8f}), 0.0, 1.0);
            return 5000 * -to_point.z / (d * d * d) * t * t * (3 - 2 * t);
        },
        2e-3);
}

TEST(RectangleLight, IsTheMeanOverItsArea) {
    expect_irradiance(
        over_a_plane(panel({10, 0, 80}, {40, 25}, 4000, ARHOST_FALLOFF_INVERSE_SQUARE),
                     {{"samples", "64"}, {"light_samples", "16"}}),
        [](glm::dvec3 p) {
            double sum = 0;
            constexpr int n = 40;
            for (int i = 0; i < n * n; ++i) {
                const glm::dvec3 from(10 + 40 * ((i % n + 0.5) / n * 2 - 1), 25 * ((i / n + 0.5) / n * 2 - 1), 80);
                const double d = glm::length(from - p);
                sum += 4000 * 80 * 80 / (d * d * d * d);
            }
            return sum / (n * n);
        },
        0.02);
}

TEST(RectangleLight, EmitsToOneSideOnly) {
    arhost_light upwards = placed(ARHOST_LIGHT_RECTANGLE, {10, 0, 80}, 4000);
    set3(upwards.direction, 0, 0, 1);
    expect_irradiance(over_a_plane(upwards), [](glm::dvec3) { return 0; });
}

TEST(SphereLight, IsAPointLightIfItsRadiusIsZero) {
    expect_irradiance(over_a_plane(bulb({30, -20, 90}, 1e-3f, 0.7f)), [](glm::dvec3 p) {
        const glm::dvec3 to_point = glm::dvec3(30, -20, 90) - p;
        return 0.7 * to_point.z / glm::length(to_point);
    });
}

TEST(SphereLight, CastsSoftShadowsWithAFullyDarkCore) {
    const auto alphas = shadow_of_a_ball(bulb({0, -20, 200}, 20));
    EXPECT_GT(alphas.at(153), 50);
    int between = 0;
    for (const auto &[alpha, count] : alphas) {
        EXPECT_TRUE(alpha <= 153 || alpha == 255) << alpha;
        between += alpha > 0 && alpha < 153 ? count : 0;
    }
    EXPECT_GT(between, 200);
}

// A mirror of reflectivity 0.8 in the plane z = 0, whose surroundings are black.
Picture of_a_mirror(const arhost_light &lamp) {
    SceneBuilder builder({.background = glm::vec3(0)});
    builder.add_mesh("mirror", square(200), mirror(0.8f));
    builder.add_light(lamp);
    return Tracer(std::move(builder)).render(from_above());
}

// Returns the point at z = 80 that a pixel of from_above() shows in the mirror z = 0.
glm::dvec3 in_the_mirror(int x, int y) {
    return on_the_floor(x, y) * 1.4 + glm::dvec3(0, 0, 80);
}

TEST(RectangleLight, IsVisibleInMirrors) {
    constexpr double pi = 3.14159265;
    for (const arhost_falloff falloff : {ARHOST_FALLOFF_NONE, ARHOST_FALLOFF_INVERSE_SQUARE}) {
        const bool falls_off = falloff == ARHOST_FALLOFF_INVERSE_SQUARE;
        arhost_light lamp = panel({10, -5, 80}, {40, 25}, falls_off ? 500.0f : 0.05f, falloff);
        const Picture picture = of_a_mirror(lamp);
        int seen = 0;
        for (int y = 0; y < 150; y += 3)
            for (int x = 0; x < 200; x += 3) {
                const glm::dvec3 at = in_the_mirror(x, y), from = on_the_floor(x, y);
                const double beyond = std::max(std::abs(at.x - 10) - 40, std::abs(at.y + 5) - 25);
                if (std::abs(beyond) < 0.01)
                    continue;
                // The radiance that illuminates a surface at the mirror as the lamp does.
                const double squared = falls_off ? 1 : glm::dot(at - from, at - from);
                const double radiance = lamp.intensity[0] * squared * pi / (80 * 50);
                ASSERT_TRUE(is_code_of(picture.at(x, y)[0], beyond < 0 ? 0.8 * radiance : 0, 1e-3)) << x << " " << y;
                seen += beyond < 0;
            }
        EXPECT_GT(seen, 100);
        set3(lamp.direction, 0, 0, 1);
        EXPECT_EQ(of_a_mirror(lamp).at(100, 74)[0], 0) << "its back is invisible";
    }
}

TEST(SphereLight, IsVisibleInMirrorsAndThroughGlass) {
    const arhost_light lamp = bulb({0, 0, 80}, 30, 500, ARHOST_FALLOFF_INVERSE_SQUARE);
    const Picture picture = of_a_mirror(lamp);
    EXPECT_NEAR(shading::srgb_decode(picture.at(100, 74)[0] / 255.0), 0.8 * 500 / (30 * 30), 0.01);
    EXPECT_EQ(picture.at(160, 74)[0], 0);

    SceneBuilder builder({.background = glm::vec3(0)});
    arhost_material glass = glass_of(1.5f);
    glass.fresnel_minimum = glass.fresnel_maximum = 0;
    builder.add_mesh("pane", square(60, 150), glass);
    builder.add_light(lamp);
    EXPECT_NEAR(shading::srgb_decode(Tracer(std::move(builder)).render(from_above()).at(100, 74)[0] / 255.0),
                500.0 / (30 * 30), 0.02);
}

TEST(AreaLights, BehindAnObjectAreNotVisibleInMirrors) {
    for (const bool screen : {false, true}) {
        SceneBuilder builder({.ambient = glm::vec3(0), .background = glm::vec3(0)});
        builder.add_mesh("mirror", square(200), mirror(1));
        if (screen)
            builder.add_mesh("screen", square(20, 60), diffuse(1, 1, 1));
        builder.add_light(bulb({0, 0, 80}, 10));
        // The screen is between the mirror and the lamp. Its lower side is not lit.
        const Picture picture =
            Tracer(std::move(builder)).render(camera({0, -100, 40}, {0, 0, -80}, {0, 0, 1}, pinhole(3, 3, 100)));
        EXPECT_EQ(picture.at(1, 1)[0], screen ? 0 : 255);
    }
}

} // namespace arhost::test
