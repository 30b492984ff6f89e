// SPDX-License-Identifier: Apache-2.0
//
// Compares renderings of metals, glass and rough surfaces with the formulas of these materials.
#include "rich_scene.hpp"

#include <arhost/shading/scalar.hpp>

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace arhost::test {
namespace {

arhost_material clear_glass(float index = 1.5f) {
    arhost_material glass = glass_of(index);
    glass.importance_cutoff = 0;
    return glass;
}
arhost_material without_reflection(arhost_material glass) {
    glass.fresnel_minimum = glass.fresnel_maximum = 0;
    return glass;
}

scene::TriangleMesh box(glm::vec3 low, glm::vec3 high) {
    scene::TriangleMesh mesh = cube(1);
    for (glm::vec3 &p : mesh.positions)
        p = (low + high) * 0.5f + p * (high - low) * 0.5f;
    return mesh;
}

SceneBuilder in_a_room_of_light(float light, std::uint32_t max_depth = 60) {
    return SceneBuilder({.max_depth = max_depth, .ambient = glm::vec3(0), .background = glm::vec3(light)});
}
constexpr glm::vec4 centre_ball(0, 0, 0, 60);

// Renders a ball of this material in the centre of a room of light.
Picture ball_in_a_room(float light, const arhost_material &material, std::uint32_t max_depth = 60) {
    SceneBuilder builder = in_a_room_of_light(light, max_depth);
    builder.add_ball("ball", centre_ball, material);
    return Tracer(std::move(builder)).render(from_above());
}

// Returns the cosine of the angle at which a pixel's ray hits the ball in the centre, or nothing if the ray misses.
// The distance t of the hit solves t² + 2 b t + c = 0.
std::optional<double> cosine_on_ball(int x, int y) {
    const glm::dvec3 eye(0, 0, 200), d = glm::normalize(on_the_floor(x, y) - eye);
    const double b = glm::dot(eye, d), root = b * b - (200.0 * 200 - 60 * 60);
    if (root < 0)
        return {};
    return -glm::dot(d, (eye + d * (-b - std::sqrt(root))) / 60.0);
}

} // namespace

TEST(Metal, FollowsSchlick) {
    arhost_material metal = scene::make_material(ARHOST_MATERIAL_METAL);
    set3(metal.reflectivity, 0.5f, 0.3f, 0.1f);
    const Picture picture = ball_in_a_room(0.6f, metal);
    for (int x = 100; x < 155; x += 2)
        if (const auto cosine = cosine_on_ball(x, 74))
            for (int i = 0; i < 3; ++i) {
                const double r0 = metal.reflectivity[i], r = r0 + (1 - r0) * std::pow(1 - *cosine, 5);
                ASSERT_TRUE(is_code_of(picture.at(x, 74)[i], 0.6 * r, 1e-3)) << x;
            }
}

TEST(Glass, ConservesEnergy) {
    for (const char *mode : {"tree", "path"}) {
        arhost_material glass = clear_glass();
        set3(glass.cutoff_colour, 0.5f, 0.5f, 0.5f); // rays cut off inside the glass get the environment's radiance
        SceneBuilder builder = in_a_room_of_light(0.5f, std::string(mode) == "tree" ? 12 : 60);
        builder.add_ball("ball", centre_ball, glass);
        builder.add_mesh("box", box({50, -60, -20}, {90, 60, 30}), glass);
        const Picture picture = Tracer(std::move(builder), {{"glass", mode}}).render(from_the_side());
        int covered = 0;
        for (const Pixel &pixel : picture.pixels())
            if (pixel[3] == 255) {
                ++covered;
                ASSERT_TRUE(is_code_of(pixel[0], 0.5, 2e-3)) << mode;
            }
        EXPECT_GT(covered, 5000);
    }
}

TEST(Glass, RefractsBySnellsLaw) {
    // The scene is a glass slab over a floor that is black for y < 7 and white for y > 7.
    constexpr double top = 40, bottom = 10, index = 1.5;
    SceneBuilder builder({.max_depth = 60, .ambient = glm::vec3(1), .background = glm::vec3(0)});
    builder.add_mesh("slab", box({-300, -300, bottom}, {300, 300, top}), without_reflection(clear_glass(index)));
    builder.add_mesh("left", moved(square(400), {0, -393, 0}), flat(0, 0, 0));
    builder.add_mesh("right", moved(square(400), {0, 407, 0}), flat(1, 1, 1));
    const Picture picture = Tracer(std::move(builder)).render(from_the_side());
    const glm::dvec3 eye(0, -150, 110), w = glm::normalize(eye), u(1, 0, 0), v = glm::cross(w, u);
    int sure = 0;
    for (int y = 0; y < 150; ++y)
        for (int x = 0; x < 200; ++x) {
            const glm::dvec3 d = glm::normalize(u * ((x - 99.5) / 200) - v * ((y - 74.5) / 200) - w);
            const glm::dvec3 in = eye + d * ((eye.z - top) / -d.z);
            glm::dvec3 refracted = d / index;
            refracted.z = -std::sqrt(1 - (refracted.x * refracted.x + refracted.y * refracted.y));
            const glm::dvec3 out = in + refracted * ((top - bottom) / -refracted.z);
            const glm::dvec3 on_floor = out + d * (bottom / -d.z);
            if (std::abs(on_floor.y - 7) < 0.01 || std::abs(on_floor.x) > 300)
                continue;
            ++sure;
            ASSERT_EQ(picture.at(x, y)[0], on_floor.y < 7 ? 0 : 255) << x << " " << y;
        }
    EXPECT_GT(sure, 20000);
}

TEST(Glass, AbsorbsByBouguersLaw) {
    arhost_material glass = without_reflection(clear_glass(1)); // index 1: no refraction
    set3(glass.extinction, 0.01f, 0.02f, 0);
    SceneBuilder builder = in_a_room_of_light(1);
    builder.add_mesh("slab", box({-300, -300, -30}, {300, 300, 0}), glass);
    const Picture picture = Tracer(std::move(builder)).render(from_above());
    for (int x = 0; x < 200; x += 7) {
        const double distance = 30 * glm::length(on_the_floor(x, 60) - glm::dvec3(0, 0, 200)) / 200;
        ASSERT_TRUE(is_code_of(picture.at(x, 60)[0], std::exp(-0.01 * distance), 1e-4));
        ASSERT_TRUE(is_code_of(picture.at(x, 60)[1], std::exp(-0.02 * distance), 1e-4));
        ASSERT_EQ(picture.at(x, 60)[2], 255);
    }
}

TEST(Glass, IgnoresRoughnessWithoutThePathIntegrator) {
    arhost_material glass = clear_glass();
    set3(glass.extinction, 0.01f, 0.02f, 0.03f);
    const Picture clear = ball_in_a_room(1, glass);
    glass.roughness = 0.5f;
    EXPECT_EQ(ball_in_a_room(1, glass).pixels(), clear.pixels());
}

TEST(Glass, ShowsItsCutoffColourForCutOffRays) {
    const auto with = [](auto change, std::uint32_t max_depth = 60) {
        arhost_material glass = clear_glass();
        set3(glass.cutoff_colour, 0.34f, 0.55f, 0.85f);
        change(glass);
        return ball_in_a_room(0, glass, max_depth).at(100, 74);
    };
    const Pixel cutoff{shading::srgb8_exact(0.34f), shading::srgb8_exact(0.55f), shading::srgb8_exact(0.85f), 255};
    EXPECT_EQ(with([](arhost_material &glass) { glass.reflection_depth = glass.refraction_depth = 0; }), cutoff);
    EXPECT_EQ(with([](arhost_material &) {}, 0), cutoff);
    EXPECT_EQ(with([](arhost_material &glass) { glass.importance_cutoff = 1; }), cutoff);
    // At normal incidence, the surface reflects 4 % of the light that enters and 4 % of the rest when it leaves. Only
    // these reflected rays are cut off.
    const Pixel thin = with([](arhost_material &glass) { glass.reflection_depth = 0; });
    EXPECT_TRUE(is_code_of(thin[1], 0.55 * (0.04 + 0.96 * 0.04), 1e-3));
    // The reflected rays have a throughput of at most 4 %, all other rays of at least 92 %.
    EXPECT_EQ(with([](arhost_material &glass) { glass.importance_cutoff = 0.05f; }), thin);
}

TEST(Glass, ReflectanceFollowsTheMaterialsExponentWithinItsLimits) {
    for (const double exponent : {0.7, 1.5, 3.0}) {
        arhost_material glass = clear_glass();
        set3(glass.refraction, 0, 0, 0);
        glass.fresnel_exponent = static_cast<float>(exponent);
        glass.fresnel_minimum = 0.1f;
        glass.fresnel_maximum = 0.6f;
        const Picture picture = ball_in_a_room(0.8f, glass);
        int between = 0;
        for (int x = 102; x < 160; ++x)
            if (const auto cosine = cosine_on_ball(x, 74)) {
                const double r = 0.1 + 0.9 * std::pow(1 - *cosine, exponent);
                between += r < 0.6;
                ASSERT_TRUE(is_code_of(picture.at(x, 74)[0], 0.8 * std::min(r, 0.6), 1e-3)) << exponent << " " << x;
            }
        EXPECT_GT(between, 20);
    }
}

TEST(Glass, LimitsReflectionAndRefractionDepthSeparately) {
    // The ray goes through the ball's centre. At each surface, the fraction r is reflected and t is transmitted.
    constexpr double r = 0.04, t = 0.96, all = 60;
    for (const auto &[reflection_depth, refraction_depth, arriving] : {std::array{all, 0.0, r},
                                                                       {all, 1, r}, // no ray exits
                                                                       {all, 2, r + t * t},
                                                                       {all, 3, r + t * t + t * r * t},
                                                                       {0, all, t * t},
                                                                       {1, all, r + t * t},
                                                                       {2, all, r + t * t + t * r * t},
                                                                       {0, 1, 0}}) {
        arhost_material glass = clear_glass();
        glass.reflection_depth = static_cast<std::uint32_t>(reflection_depth);
        glass.refraction_depth = static_cast<std::uint32_t>(refraction_depth);
        EXPECT_TRUE(is_code_of(ball_in_a_room(0.8f, glass).at(100, 74)[0], 0.8 * arriving, 1e-3))
            << reflection_depth << " " << refraction_depth;
    }
}

TEST(Glass, MeanOfRandomPathsMatchesTheRayTree) {
    const auto scene = [] {
        SceneBuilder builder({.max_depth = 10, .ambient = glm::vec3(0.5f), .background = glm::vec3(0.9f)});
        arhost_material glass = clear_glass();
        glass.fresnel_minimum = 0.3f;
        set3(glass.extinction, 0.01f, 0, 0.02f);
        builder.add_mesh("floor", square(200, -70), flat(0.8f, 0.2f, 0.1f));
        builder.add_ball("ball", centre_ball, glass);
        return builder;
    };
    const auto mean = [&](const char *mode) {
        double sum = 0;
        for (const Pixel &pixel : Tracer(scene(), {{"glass", mode}}).render(from_the_side()).pixels())
            for (int i = 0; i < 3; ++i)
                sum += shading::srgb_decode(pixel[i] / 255.0);
        return sum / (3 * 200 * 150);
    };
    EXPECT_NEAR(mean("path") / mean("tree"), 1, 0.03) << "the tolerance covers the noise of about 3000 glass pixels";
}

TEST(Glass, ShadowAlphaOnACatcherIs77AndOfOpaqueObjects153) {
    SceneBuilder builder;
    builder.add_mesh("floor", square(80), diffuse(0.8f, 0.8f, 0.8f), ARHOST_ROLE_CATCHER);
    builder.add_ball("glass", {-20, 0, 25, 12}, clear_glass());
    builder.add_ball("ball", {20, 0, 25, 12}, diffuse(1, 0, 0));
    builder.add_mesh("over both", box({-40, -3, 60}, {40, 3, 62}), clear_glass());
    builder.add_light(light(0, -20, 300, 1));
    const auto counts = Tracer(std::move(builder)).render(from_the_side()).alphas();
    EXPECT_EQ(counts.size(), 4u);
    EXPECT_GT(counts.at(77), 100);
    EXPECT_GT(counts.at(153), 100);
}

// A catcher that is entirely in the shadow of a glass roof.
SceneBuilder under_glass(const std::vector<arhost_light> &lamps) {
    SceneBuilder builder;
    builder.add_mesh("floor", square(400), diffuse(0.8f, 0.8f, 0.8f), ARHOST_ROLE_CATCHER);
    builder.add_mesh("roof", box({-900, -900, 300}, {900, 900, 302}), clear_glass());
    for (const arhost_light &lamp : lamps)
        builder.add_light(lamp);
    return builder;
}
const std::map<int, int> only_glass_shadow{{77, 200 * 150}};

TEST(Glass, ShadowAlphaIs77ForAnySampleCount) {
    for (const char *samples : {"1", "2", "8", "11", "12", "13", "64"}) {
        Tracer tracer(under_glass({light(0, -20, 500, 1)}), {{"samples", samples}, {"accumulate", "true"}});
        ASSERT_EQ(tracer.start(pinhole()), ARHOST_STATUS_OK);
        for (int frame = 0; frame < 5; ++frame)
            EXPECT_EQ(tracer.render_next(from_above()).alphas(), only_glass_shadow) << samples << ", frame " << frame;
    }
}

TEST(Glass, ShadowAlphaIs77ForAnyNumberOfLamps) {
    Tracer tracer(
        under_glass({light(-70, -140, 500, 0.23f), light(13, 26, 500, 0.313f), light(90, 180, 500, 0.39f)}));
    EXPECT_EQ(tracer.render(from_above()).alphas(), only_glass_shadow);
}

TEST(Glass, ShadowIsColouredIfTheSceneEnablesIt) {
    const auto shadow = [](bool coloured) {
        SceneBuilder builder({.coloured_shadows = coloured});
        arhost_material glass = clear_glass();
        set3(glass.shadow_attenuation, 0.4f, 0.8f, 0.4f);
        builder.add_mesh("floor", square(80), diffuse(0.8f, 0.8f, 0.8f), ARHOST_ROLE_CATCHER);
        builder.add_mesh("pane", box({-20, -20, 50}, {20, 20, 51}), glass);
        builder.add_light(light(0, 150, 300, 1));
        return Tracer(std::move(builder)).render(camera({0, -150, 20}, {0, -30, 0}, {0, 0, 1})).at(100, 74);
    };
    EXPECT_EQ(shadow(false), (Pixel{0, 0, 0, 77}));
    const Pixel green = shadow(true);
    EXPECT_GT(green[1], green[0] + 50);
    EXPECT_EQ(green[0], 0) << "the strongest channel determines the alpha";
    // Two surfaces transmit 0.16 of red and thus hide 0.84 of it.
    EXPECT_NEAR(green[3], 255 * shading::shadow_alpha(0.84, 0, 0.6, 0), 2);
}

// Returns the light of the sun on a white floor under a block of glass.
Pixel under_a_block(const arhost_material &glass, float thickness) {
    SceneBuilder builder = in_a_room_of_light(0);
    builder.add_mesh("floor", square(80), diffuse(1, 1, 1));
    builder.add_mesh("block", box({-20, -20, 50}, {20, 20, 50 + thickness}), glass);
    builder.add_light(sun());
    return Tracer(std::move(builder)).render(camera({0, -150, 20}, {0, -15, 0}, {0, 0, 1})).at(100, 74);
}

TEST(Glass, ShadowTintsTheLightOnObjects) {
    arhost_material glass = clear_glass();
    set3(glass.shadow_attenuation, 0.5f, 0.8f, 0.2f);
    const Pixel pixel = under_a_block(glass, 1);
    for (int i = 0; i < 3; ++i)
        EXPECT_TRUE(is_code_of(pixel[i], glass.shadow_attenuation[i] * glass.shadow_attenuation[i], 1e-4));
}

TEST(Glass, ShadowOnObjectsIsAbsorbedInsideTheGlass) {
    arhost_material glass = clear_glass();
    set3(glass.extinction, 0.01f, 0.002f, 0);
    const Pixel pixel = under_a_block(glass, 40);
    for (int i = 0; i < 3; ++i)
        EXPECT_TRUE(is_code_of(pixel[i], 0.6 * 0.6 * std::exp(-40.0 * glass.extinction[i]), 1e-3)) << i;
}

// Fraction of light that rough metal, which reflects all light, reflects at normal incidence. A microfacet normal is
// sampled at the angle θ to the surface normal, with tan² θ = α² v/(1 − v) for uniform v; the reflected ray leaves at
// the angle 2θ.
double albedo_at_normal_incidence(double roughness) {
    double sum = 0;
    constexpr int n = 10000;
    const double alpha = shading::ggx_alpha(roughness);
    for (int i = 0; i < n; ++i) {
        const double v = (i + 0.5) / n, tan2 = alpha * alpha * v / (1 - v), cosine = (1 - tan2) / (1 + tan2);
        sum += cosine > 0 ? shading::ggx_masking(cosine, alpha) / n : 0;
    }
    return sum;
}

arhost_material white_metal(float roughness) {
    return metallic_roughness(glm::vec3(1), 1, roughness);
}

// Mean linear light of the 25 central pixels.
double light_in_the_middle(const Picture &picture) {
    double mean = 0;
    for (std::uint32_t i = 0; i < 25; ++i)
        mean += shading::srgb_decode(picture.at(98 + i % 5, 72 + i / 5)[0] / 255.0) / 25;
    return mean;
}

TEST(Rough, WhiteMetalLosesOnlyMaskedLight) {
    for (const bool environment : {false, true})
        for (const float roughness : {0.0f, 0.3f, 0.6f, 1.0f}) {
            SceneBuilder builder = in_a_room_of_light(0.5f);
            if (environment)
                add_environment(builder, [](std::uint32_t) { return glm::vec3(0.5f); });
            builder.add_ball("ball", centre_ball, white_metal(roughness));
            const Picture picture = Tracer(std::move(builder), {{"samples", "64"}}).render(from_above());
            const double expected = 0.5 * albedo_at_normal_incidence(roughness);
            EXPECT_NEAR(light_in_the_middle(picture) / expected, 1, 0.01) << roughness << " " << environment;
        }
}

TEST(Rough, BackgroundIsReflectedAtTheDepthLimit) {
    SceneBuilder builder = in_a_room_of_light(0.5f, 0);
    builder.add_ball("ball", centre_ball, white_metal(0.6f));
    const Picture picture =
        Tracer(std::move(builder), {{"samples", "64"}, {"light_samples", "16"}}).render(from_above());
    EXPECT_NEAR(light_in_the_middle(picture) / (0.5 * albedo_at_normal_incidence(0.6)), 1, 0.03);
}

// Root mean square of the relative deviation of the 25 central pixels from this light.
double noise_in_the_middle(const Picture &picture, double light) {
    double squares = 0;
    for (std::uint32_t i = 0; i < 25; ++i)
        squares += std::pow(shading::srgb_decode(picture.at(98 + i % 5, 72 + i / 5)[0] / 255.0) / light - 1, 2) / 25;
    return std::sqrt(squares);
}

// Area lights and environments are sampled in two ways: reflected rays rarely hit a small light, and samples of the
// light rarely lie in a narrow lobe. The combination must have the right brightness and little noise in both cases.
TEST(Rough, ReflectionsOfAreaLightsAreRightAndSmoothForEveryRoughness) {
    for (const float roughness : {0.0f, 0.15f, 0.5f, 1.0f}) {
        // A panel of 60 mm × 60 mm is 100 mm above a metal plane.
        SceneBuilder builder = in_a_room_of_light(0);
        builder.add_mesh("plane", square(200), white_metal(roughness));
        constexpr float radiance = 0.8f;
        builder.add_light(panel({0, 0, 100}, {30, 30}, radiance * 3600 / 3.14159265f, ARHOST_FALLOFF_INVERSE_SQUARE));
        const Picture picture = Tracer(std::move(builder), {{"samples", "64"}}).render(from_above());
        // Compare the central pixels with the integral over reflected directions.
        const double alpha = shading::ggx_alpha(roughness);
        double sum = 0;
        constexpr int n = 400;
        for (int i = 0; i < n * n; ++i) {
            const shading::Vec3 normal{0, 0, 1};
            const auto l = shading::mirror_direction(
                {0, 0, -1}, shading::ggx_half_vector(normal, normal, alpha, (i / n + 0.5) / n, (i % n + 0.5) / n));
            if (l.z > 0 && std::abs(l.x / l.z) < 0.3 && std::abs(l.y / l.z) < 0.3)
                sum += radiance * shading::ggx_masking(l.z, alpha) / (n * n);
        }
        EXPECT_NEAR(light_in_the_middle(picture) / sum, 1, 0.02) << roughness;
        EXPECT_LT(noise_in_the_middle(picture, sum), 0.05) << "noise, " << roughness;
    }
}

TEST(Rough, ReflectionsOfEnvironmentsWithFewBrightTexelsAreRightAndSmooth) {
    for (const float roughness : {0.5f, 0.75f, 1.0f}) {
        SceneBuilder builder = in_a_room_of_light(0);
        add_environment(builder, [](std::uint32_t column) { return glm::vec3(column == 2 ? 4.0f : 0.0f); });
        builder.add_mesh("plane", square(200), white_metal(roughness));
        const Picture picture = Tracer(std::move(builder), {{"samples", "64"}}).render(from_above());
        // The lobe is rotationally symmetric, and one of eight columns is bright.
        const double expected = 4 / 8.0 * albedo_at_normal_incidence(roughness);
        EXPECT_NEAR(light_in_the_middle(picture) / expected, 1, 0.02) << roughness;
        EXPECT_LT(noise_in_the_middle(picture, expected), 0.08) // half of the light is below the plane
            << "noise, " << roughness;
    }
}

// Linear light of a metal plane beside a ball, which reflects a small, bright lamp to the plane or lets its light
// through.
Picture beside_a_ball(const arhost_material &ball, float roughness) {
    SceneBuilder builder = in_a_room_of_light(0, 4);
    builder.add_mesh("plane", square(200), white_metal(roughness));
    builder.add_ball("ball", {0, 0, 30, 30}, ball);
    builder.add_light(bulb({100, 0, 250}, 10, 0.1f));
    return Tracer(std::move(builder), {{"samples", "16"}}).render(from_above());
}

// A rough surface cannot sample a lamp that it sees in a mirror or refracted by glass: the few reflected rays that
// arrive there would be bright spots.
TEST(Rough, ReflectionsOfLampsInMirrorsAndGlassHaveNoBrightSpots) {
    for (const arhost_material &ball : {mirror(1), clear_glass()})
        for (const float roughness : {0.5f, 0.0f}) {
            const Picture picture = beside_a_ball(ball, roughness);
            int bright = 0;
            for (int y = 0; y < 150; ++y)
                for (int x = 0; x < 200; ++x)
                    if (glm::length(on_the_floor(x, y)) > 45) // not the ball
                        bright += picture.at(x, y)[0] > 200;
            if (roughness > 0)
                EXPECT_EQ(bright, 0) << (ball.model == ARHOST_MATERIAL_MIRROR ? "mirror" : "glass");
            else
                EXPECT_GT(bright, 0) << "a smooth surface shows the lamp";
        }
}

TEST(Rough, PlasticPlaneMatchesTheGltfFormulas) {
    arhost_material plastic = metallic_roughness({0.6f, 0.3f, 0.1f}, 0.25f, 0.5f);
    set3(plastic.emission, 0, 0, 0.05f);
    SceneBuilder builder = in_a_room_of_light(0);
    builder.add_mesh("plane", square(200), plastic);
    builder.add_light(light(30, -20, 90, 0.9f));
    const Picture picture = Tracer(std::move(builder)).render(from_above());
    for (int y = 0; y < 150; y += 5)
        for (int x = 0; x < 200; x += 5) {
            const glm::dvec3 p = on_the_floor(x, y), l = glm::normalize(glm::dvec3(30, -20, 90) - p);
            const glm::dvec3 v = glm::normalize(glm::dvec3(0, 0, 200) - p), h = glm::normalize(l + v);
            const double a2 = std::pow(0.5, 4), d = h.z * h.z * (a2 - 1) + 1;
            const double visibility =
                1 / ((l.z + std::sqrt(l.z * l.z * (1 - a2) + a2)) * (v.z + std::sqrt(v.z * v.z * (1 - a2) + a2)));
            for (int i = 0; i < 3; ++i) {
                const double base = plastic.diffuse[i], f0 = 0.04 * 0.75 + base * 0.25;
                const double grazing = std::pow(1 - glm::dot(v, h), 5), fresnel = f0 + (1 - f0) * grazing;
                const double of_dielectric = 0.04 + 0.96 * grazing;
                // The unit of light intensities includes the factor π, so that Lambert's term has no 1/π.
                const double value =
                    0.9 * l.z * ((1 - of_dielectric) * base * 0.75 + fresnel * visibility * a2 / (d * d)) +
                    plastic.emission[i];
                ASSERT_TRUE(is_code_of(picture.at(x, y)[i], value, 1e-3)) << x << " " << y;
            }
        }
}

} // namespace arhost::test
