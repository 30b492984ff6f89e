// SPDX-License-Identifier: Apache-2.0
//
// The path integrator, compared with closed formulas.
#include "linear_tracer.hpp"
#include "raytracer_common/video.hpp"
#include "rich_scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace arhost::test {
namespace {

scene::Settings path_settings(float background = 0, std::uint32_t max_depth = 8) {
    scene::Settings settings;
    settings.integrator = ARHOST_INTEGRATOR_PATH;
    settings.ambient = glm::vec3(0);
    settings.background = glm::vec3(background);
    settings.max_depth = max_depth;
    return settings;
}

arhost_material emissive(float radiance, float albedo = 0) {
    arhost_material material = diffuse(albedo, albedo, albedo);
    set3(material.emission, radiance, radiance, radiance);
    return material;
}

LinearPicture rendered(SceneBuilder scene, const arhost_camera &view, const Options &options = {{"samples", "64"}},
                       std::uint64_t sequence = 0, const Video *video = nullptr) {
    LinearTracer tracer(std::move(scene), options, "rt_embree");
    EXPECT_EQ(tracer.start(view.intrinsics, video), ARHOST_STATUS_OK) << tracer.log();
    return tracer.render(view, sequence, video);
}

// Mean of a channel over the pixels of a square around (x, y).
double mean_at(const LinearPicture &picture, std::uint32_t x, std::uint32_t y, std::size_t channel, int half = 2) {
    double sum = 0;
    for (int dy = -half; dy <= half; ++dy)
        for (int dx = -half; dx <= half; ++dx)
            sum += picture.value(x + static_cast<std::uint32_t>(dx), y + static_cast<std::uint32_t>(dy), channel);
    return sum / ((2 * half + 1) * (2 * half + 1));
}

constexpr std::size_t transmittance = 4;

// A table from above: pixel (x, y) of from_above() shows the point on_the_floor(x, y).
SceneBuilder table(const scene::Settings &settings, float albedo = 0.5f) {
    SceneBuilder scene(settings);
    scene.add_mesh("table", square(2000), diffuse(albedo, albedo, albedo), ARHOST_ROLE_CATCHER);
    return scene;
}

TEST(PathIntegrator, ConvexSurfaceInAFurnaceReflectsItsAlbedo) {
    SceneBuilder scene(path_settings(1));
    scene.add_ball("ball", {0, 0, 0, 40}, diffuse(0.8f, 0.5f, 0.2f));
    const LinearPicture picture = rendered(std::move(scene), from_above());
    EXPECT_NEAR(mean_at(picture, 100, 75, 0), 0.8, 0.008);
    EXPECT_NEAR(mean_at(picture, 100, 75, 1), 0.5, 0.005);
    EXPECT_NEAR(mean_at(picture, 100, 75, 2), 0.2, 0.002);
    EXPECT_EQ(picture.value(100, 75, transmittance), 0);
}

TEST(PathIntegrator, GlassInAFurnaceIsInvisible) {
    SceneBuilder scene(path_settings(1, 32));
    scene.add_ball("ball", {0, 0, 0, 40}, glass_of());
    const LinearPicture picture = rendered(std::move(scene), from_above());
    EXPECT_NEAR(mean_at(picture, 100, 75, 0), 1, 0.01);
    EXPECT_NEAR(mean_at(picture, 125, 75, 0), 1, 0.01);
}

TEST(PathIntegrator, LightBouncesInAClosedBox) {
    SceneBuilder scene(path_settings(0, 64));
    scene.add_mesh("box", cube(100), emissive(0.5f, 0.5f));
    const LinearPicture picture =
        rendered(std::move(scene), camera({0, 0, 0}, {0, 1, 0}, {0, 0, 1}), {{"samples", "16"}});
    double sum = 0;
    for (std::uint32_t y = 0; y < 150; ++y)
        for (std::uint32_t x = 0; x < 200; ++x)
            sum += picture.value(x, y, 0);
    EXPECT_NEAR(sum / (200 * 150), 0.5 / (1 - 0.5), 0.01);
}

TEST(PathIntegrator, BlackBallShadowsACatcherByItsFormFactor) {
    constexpr double radius = 20, height = 40;
    SceneBuilder scene = table(path_settings(1));
    scene.add_ball("ball", {0, 0, height, radius}, diffuse(0, 0, 0));
    const LinearPicture picture = rendered(std::move(scene), from_above(), {{"samples", "256"}});
    for (const std::uint32_t x : {135u, 150u, 180u}) {
        const double distance = on_the_floor(static_cast<int>(x), 75).x,
                     squared = distance * distance + height * height;
        const double form_factor = radius * radius / squared * height / std::sqrt(squared);
        EXPECT_NEAR(mean_at(picture, x, 75, transmittance), 1 - form_factor, 0.01) << x;
    }
}

TEST(PathIntegrator, EmissiveBallLightsACatcher) {
    constexpr double radius = 15, height = 50, radiance = 4;
    SceneBuilder scene = table(path_settings());
    scene.add_light(sun(0.6f, 0, -0.8f));
    scene.add_ball("ball", {0, 0, height, radius}, emissive(radiance));
    const LinearPicture picture = rendered(std::move(scene), from_above(), {{"samples", "64"}});
    const double distance = on_the_floor(60, 75).x, squared = distance * distance + height * height; // not in shadow
    const double form_factor = radius * radius / squared * height / std::sqrt(squared);
    EXPECT_NEAR(mean_at(picture, 60, 75, transmittance), 1 + radiance * form_factor / 0.8, 0.02);
}

TEST(PathIntegrator, BrightObjectReflectsItsColourOntoACatcher) {
    SceneBuilder scene = table(path_settings(1));
    scene.add_mesh("wall", quad({20, -200, 0}, {20, 200, 0}, {20, 200, 200}, {20, -200, 200}), diffuse(1, 0, 0));
    const LinearPicture picture = rendered(std::move(scene), from_above(), {{"samples", "64"}});
    const double red = mean_at(picture, 110, 75, transmittance), green = mean_at(picture, 110, 75, transmittance + 1);
    EXPECT_GT(red, green + 0.1);
    EXPECT_LT(red, 1);
}

TEST(PathIntegrator, LampsOfTwoColoursMakeColouredShadows) {
    SceneBuilder scene = table(path_settings());
    arhost_light red = sun(0.6f, 0, -0.8f), blue = sun(-0.6f, 0, -0.8f);
    set3(red.intensity, 1, 0, 0);
    set3(blue.intensity, 0, 0, 1);
    scene.add_light(red);
    scene.add_light(blue);
    scene.add_ball("ball", {0, 0, 40, 10}, diffuse(0, 0, 0));
    const LinearPicture picture = rendered(std::move(scene), from_above(), {{"samples", "64"}});
    // The shadow of the red lamp is 30 mm to the right.
    EXPECT_NEAR(mean_at(picture, 130, 75, transmittance), 0, 0.05);
    EXPECT_NEAR(mean_at(picture, 130, 75, transmittance + 2), 1, 0.02);
    EXPECT_NEAR(mean_at(picture, 70, 75, transmittance), 1, 0.02);
    EXPECT_NEAR(mean_at(picture, 70, 75, transmittance + 2), 0, 0.05);
}

TEST(PathIntegrator, LeavesPixelsUntouchedThatNothingAffects) {
    SceneBuilder scene = table(path_settings());
    scene.add_light(sun());
    scene.add_ball("ball", {0, 0, 5, 5}, diffuse(1, 1, 1));
    const LinearPicture picture = rendered(std::move(scene), from_above());
    EXPECT_EQ(picture.at(2, 2), untouched);
    EXPECT_EQ(picture.at(197, 147), untouched);
    EXPECT_NE(picture.at(100, 75), untouched);
    EXPECT_TRUE(picture.info.has_region);
    EXPECT_LT(picture.info.region_width, 200u);
}

TEST(PathIntegrator, GlassFocusesTheLightOfALampOntoACatcher) {
    SceneBuilder scene = table(path_settings(0, 16));
    scene.add_light(sun());
    scene.add_ball("ball", {0, 0, 30, 20}, glass_of());
    // The camera sees the caustic past the ball.
    const arhost_camera view = camera({0, -200, 60}, {0, 0, 0}, {0, 0, 1});
    const LinearPicture picture = rendered(std::move(scene), view, {{"samples", "16"}, {"photons", "65536"}});
    float brightest = 0;
    for (std::uint32_t y = 0; y < 150; ++y)
        for (std::uint32_t x = 0; x < 200; ++x)
            brightest = std::max(brightest, picture.value(x, y, transmittance));
    EXPECT_GT(brightest, 4);
}

// All light of a lamp in the middle of a glass ball leaves the ball without refraction.
TEST(PathIntegrator, GlassAroundALampChangesNothing) {
    for (const float radius : {0.0f, 2.0f}) {
        SceneBuilder scene = table(path_settings(0, 16));
        scene.add_light(radius > 0 ? bulb({0, 0, 60}, radius, 1e4f, ARHOST_FALLOFF_INVERSE_SQUARE)
                                   : light(0, 0, 60, 1e4f, ARHOST_FALLOFF_INVERSE_SQUARE));
        scene.add_ball("ball", {0, 0, 60, 20}, glass_of());
        const LinearPicture picture = rendered(std::move(scene), camera({0, -150, 30}, {0, -40, 0}, {0, 0, 1}),
                                               {{"samples", "16"}, {"photons", "200000"}});
        EXPECT_NEAR(mean_at(picture, 100, 75, transmittance, 8), 1, 0.03) << radius;
    }
}

// A pane of glass, 4 mm thick, at the height of 60 mm.
void add_pane(SceneBuilder &scene, float roughness, float side = 200, float index = 1.5f) {
    scene::TriangleMesh pane = cube(0.5f);
    for (glm::vec3 &position : pane.positions)
        position = {position.x * side, position.y * side, position.z * 4 + 60};
    scene.add_mesh("pane", pane, glass_of(index, roughness), ARHOST_ROLE_VIRTUAL, glm::mat4x3(1));
}

TEST(PathIntegrator, GlassOfIndexOneChangesNoLamp) {
    for (const arhost_falloff falloff : {ARHOST_FALLOFF_NONE, ARHOST_FALLOFF_INVERSE_SQUARE}) {
        SceneBuilder scene = table(path_settings(0, 16));
        scene.add_light(light(0, 0, 100, falloff == ARHOST_FALLOFF_NONE ? 1 : 1e4f, falloff));
        add_pane(scene, 0, 200, 1);
        const LinearPicture picture = rendered(std::move(scene), camera({0, -100, 50}, {0, 0, 0}, {0, 0, 1}),
                                               {{"samples", "16"}, {"photons", "65536"}});
        EXPECT_NEAR(mean_at(picture, 100, 75, transmittance, 8), 1, 0.02) << falloff;
    }
}

// A pane with parallel faces shifts the light, and reflects twice F = 4 % of it, with the reflections inside
// 2F/(1+F). A slightly rough one sends as much light to the table below its middle.
TEST(PathIntegrator, PaneOfGlassLosesTheReflectedLight) {
    for (const float roughness : {0.0f, 0.15f}) {
        SceneBuilder scene = table(path_settings(0, 16), 0); // a black table: the pane reflects no light back onto it
        scene.add_light(sun());
        add_pane(scene, roughness);
        // From below the pane, past its lower face.
        const arhost_camera view = camera({0, -100, 50}, {0, 0, 0}, {0, 0, 1});
        const LinearPicture picture =
            rendered(std::move(scene), view, {{"samples", "64"}, {"photons", "16384"}, {"light_samples", "1"}});
        EXPECT_NEAR(mean_at(picture, 100, 75, transmittance, 8), 1 - 2 * 0.04 / 1.04, 0.015) << roughness;
    }
}

// Returns the light that a rough pane in a furnace of radiance 1 sends along its normal, by a random walk whose
// microfacets are sampled by their distribution (B. Walter et al., Microfacet Models for Refraction, EGSR 2007).
double light_of_a_rough_pane(double roughness) {
    constexpr double index = 1.5;
    constexpr int walks = 200'000;
    const double alpha = roughness * roughness;
    std::mt19937 engine;
    std::uniform_real_distribution<double> random;
    const auto masking = [alpha](double cosine) {
        return 2 / (1 + std::sqrt(1 + alpha * alpha * (1 / (cosine * cosine) - 1)));
    };
    double sum = 0;
    for (int i = 0; i < walks; ++i) {
        glm::dvec3 to_eye(0, 0, 1); // z: along the normal on the side of the eye
        double weight = 1;
        for (bool inside = false;;) {
            const double u = random(engine), turn = 2 * std::numbers::pi * random(engine);
            const double z = std::sqrt((1 - u) / (1 + (alpha * alpha - 1) * u)), sine = std::sqrt(1 - z * z);
            const glm::dvec3 facet(sine * std::cos(turn), sine * std::sin(turn), z);
            const double cosine = glm::dot(to_eye, facet), ratio = inside ? index : 1 / index;
            if (cosine <= 0) {
                weight = 0;
                break;
            }
            const double squared = 1 - ratio * ratio * (1 - cosine * cosine);
            double reflectance = 1;
            if (squared > 0) {
                const double refracted = std::sqrt(squared);
                const double parallel = (cosine - ratio * refracted) / (cosine + ratio * refracted),
                             perpendicular = (ratio * cosine - refracted) / (ratio * cosine + refracted);
                reflectance = (parallel * parallel + perpendicular * perpendicular) / 2;
            }
            const bool reflects = random(engine) < reflectance;
            const glm::dvec3 out =
                reflects ? 2 * cosine * facet - to_eye
                         : (ratio * cosine - std::sqrt(std::max(squared, 0.0))) * facet - ratio * to_eye;
            if (reflects ? out.z <= 0 : out.z >= 0) {
                weight = 0;
                break;
            }
            weight *= masking(to_eye.z) * masking(out.z) * cosine / (to_eye.z * z);
            if (reflects != inside)
                break;
            inside = true;
            // The ray arrives at the other face from inside.
            to_eye = reflects ? glm::dvec3(-out.x, -out.y, out.z) : -out;
        }
        sum += weight;
    }
    return sum / walks;
}

TEST(PathIntegrator, RoughPaneInAFurnaceLosesTheLightOfFurtherScattering) {
    for (const float roughness : {0.3f, 0.6f, 1.0f}) {
        SceneBuilder scene(path_settings(1, 64));
        add_pane(scene, roughness, 1e5f);
        const LinearPicture picture = rendered(std::move(scene), from_above(), {{"samples", "64"}});
        EXPECT_NEAR(mean_at(picture, 100, 75, 0, 8), light_of_a_rough_pane(roughness), 0.01) << roughness;
    }
}

// A pane above a floor whose left half shines.
TEST(PathIntegrator, FrostedPaneBlursWhatIsBehindIt) {
    const auto render = [](float roughness) {
        SceneBuilder scene(path_settings());
        scene.add_mesh("floor", quad({-200, -200, 0}, {0, -200, 0}, {0, 200, 0}, {-200, 200, 0}), emissive(1));
        add_pane(scene, roughness);
        return rendered(std::move(scene), from_above());
    };
    const LinearPicture clear = render(0), nearly_clear = render(0.01f), frosted = render(0.6f);
    for (const std::uint32_t x : {60u, 80u, 95u, 105u, 120u, 140u})
        EXPECT_NEAR(mean_at(nearly_clear, x, 75, 0), mean_at(clear, x, 75, 0), 0.01) << x;
    EXPECT_GT(mean_at(clear, 95, 75, 0), 0.9);
    EXPECT_LT(mean_at(clear, 105, 75, 0), 0.01);
    EXPECT_LT(mean_at(frosted, 95, 75, 0), 0.7);
    EXPECT_GT(mean_at(frosted, 105, 75, 0), 0.25);
    EXPECT_GT(mean_at(frosted, 95, 75, 0), mean_at(frosted, 105, 75, 0));
}

TEST(PathIntegrator, ShowsTheFilmedTableInAMirror) {
    SceneBuilder scene = table(path_settings());
    scene.add_light(sun());
    scene.add_mesh("mirror", quad({-60, 40, 0}, {60, 40, 0}, {60, 40, 80}, {-60, 40, 80}), mirror(1));
    const arhost_camera view = camera({0, -150, 100}, {0, 0, 0}, {0, 0, 1});
    const Video video(view.intrinsics);
    const LinearPicture picture = rendered(std::move(scene), view, {{"samples", "4"}}, 0, &video);
    // The table in front of the mirror's middle, as far before it as it appears behind it.
    const auto project = [&](glm::dvec3 p) {
        const double length = std::hypot(150.0, 100.0);
        const glm::dvec3 forward(0, 150 / length, -100 / length), down(0, -100 / length, -150 / length);
        const glm::dvec3 d = p - glm::dvec3(0, -150, 100);
        const double depth = d.y * forward.y + d.z * forward.z;
        return glm::dvec2(99.5 + 200 * d.x / depth, 74.5 + 200 * (d.y * down.y + d.z * down.z) / depth);
    };
    const glm::dvec2 reflected = project({20, 10, 0}), seen = project({20, 70, 0});
    const double red = shading::srgb_decode((40 + std::floor(160 * std::round(reflected.x) / 200)) / 255),
                 blue = shading::srgb_decode((40 + std::floor(160 * std::round(reflected.y) / 150)) / 255);
    const auto x = static_cast<std::uint32_t>(std::lround(seen.x)),
               y = static_cast<std::uint32_t>(std::lround(seen.y));
    EXPECT_NEAR(mean_at(picture, x, y, 0, 1), red, 0.01);
    EXPECT_NEAR(mean_at(picture, x, y, 2, 1), blue, 0.01);
}

// The mirror shows a point of the filmed table as the camera sees the same point directly.
TEST(PathIntegrator, MirrorShowsTheLightOfVirtualObjectsOnTheFilmedTable) {
    const arhost_camera view = camera({0, -150, 100}, {0, 0, 0}, {0, 0, 1});
    const Video video(view.intrinsics, 128);
    const auto pixel_of = [](double y) { // of the table's point (0, y, 0)
        const double length = std::hypot(150.0, 100.0);
        return static_cast<std::uint32_t>(std::lround(74.5 - 200 * 100 * y / length / (length + (y * 150) / length)));
    };
    const auto expect_equal = [&](SceneBuilder scene, const char *light_samples, std::size_t channel) {
        scene.add_light(sun(0.6f, 0, -0.8f));
        scene.add_mesh("mirror", quad({-60, 40, 0}, {60, 40, 0}, {60, 40, 80}, {-60, 40, 80}), mirror(1));
        const LinearPicture picture =
            rendered(std::move(scene), view, {{"samples", "256"}, {"light_samples", light_samples}, {"photons", "0"}},
                     0, &video);
        const double light = shading::srgb_decode(128 / 255.0),
                     direct = mean_at(picture, 100, pixel_of(0), transmittance + channel) * light,
                     mirrored = mean_at(picture, 100, pixel_of(80), channel);
        EXPECT_GT(direct, 1.1 * light);
        EXPECT_NEAR(mirrored, direct, 0.02 * direct) << light_samples;
    };
    for (const char *light_samples : {"1", "8"}) {
        SceneBuilder lit = table(path_settings());
        lit.add_ball("ball", {35, 0, 20, 15}, emissive(4));
        expect_equal(std::move(lit), light_samples, 0);
    }
    SceneBuilder bright = table(path_settings());
    bright.add_mesh("wall", quad({25, -60, 0}, {25, 39, 0}, {25, 39, 60}, {25, -60, 60}), diffuse(1, 1, 1));
    expect_equal(std::move(bright), "1", 1);
}

TEST(PathIntegrator, FilmedTableReflectsNoMoreThanItReceives) {
    const arhost_camera view = camera({0, -150, 100}, {0, 0, 0}, {0, 0, 1});
    const Video video(view.intrinsics, 128);
    SceneBuilder scene = table(path_settings(0.01f, 16));
    scene.add_ball("ball", {0, 20, 20, 19}, mirror(1));
    const LinearPicture picture = rendered(std::move(scene), view, {{"samples", "16"}}, 0, &video);
    double brightest = 0;
    for (std::uint32_t y = 0; y < picture.height; ++y)
        for (std::uint32_t x = 0; x < picture.width; ++x)
            brightest = std::max(brightest, double{picture.value(x, y, 0)});
    EXPECT_LT(brightest, 5);
}

// The video shows the shadows of real objects.
TEST(PathIntegrator, VirtualObjectsChangeNothingWhereARealOneHidesTheLamp) {
    const auto shadow = [](bool has_card, bool lamp_is_virtual) {
        SceneBuilder scene = table(path_settings());
        scene.add_light(sun(0, 0.01f, -1));
        if (lamp_is_virtual)
            scene.add_ball("lamp", {30, 0, 120, 5}, emissive(200));
        else
            scene.add_ball("ball", {0, 0, 20, 10}, diffuse(0, 0, 0));
        if (has_card)
            scene.add_mesh("card", quad({-60, -60, 60}, {60, -60, 60}, {60, 60, 60}, {-60, 60, 60}),
                           diffuse(0.5f, 0.5f, 0.5f), ARHOST_ROLE_OCCLUDER);
        return mean_at(rendered(std::move(scene), camera({0, -100, 20}, {0, 0, 0}, {0, 0, 1})), 100, 75,
                       transmittance);
    };
    EXPECT_LT(shadow(false, false), 0.1);
    EXPECT_NEAR(shadow(true, false), 1, 0.01);
    EXPECT_GT(shadow(false, true), 1.2);
    EXPECT_EQ(shadow(true, true), 1);
}

// A lamp in a window lies in the described wall. The wall is part of the surroundings.
TEST(PathIntegrator, DescribedWallLeavesTheShadowsOfItsWindowAndOfTheSurroundings) {
    const auto shadow = [](bool has_wall, bool has_window) {
        SceneBuilder scene = table(path_settings(has_window ? 0 : 1));
        if (has_wall)
            scene.add_mesh("wall", quad({-90, 60, 0}, {90, 60, 0}, {90, 60, 180}, {-90, 60, 180}),
                           diffuse(0.5f, 0.5f, 0.5f), ARHOST_ROLE_CATCHER);
        if (has_window) {
            arhost_light window = placed(ARHOST_LIGHT_RECTANGLE, {0, 60, 90}, 30000, ARHOST_FALLOFF_INVERSE_SQUARE);
            set3(window.direction, 0, -1, 0);
            set3(window.axis_u, 20, 0, 0);
            set3(window.axis_v, 0, 0, 20);
            scene.add_light(window);
        }
        scene.add_ball("ball", {0, 20, 40, 15}, diffuse(0, 0, 0));
        return mean_at(rendered(std::move(scene), camera({0, -100, 20}, {0, 0, 0}, {0, 0, 1})), 100, 75,
                       transmittance);
    };
    for (const bool has_window : {false, true}) {
        const double expected = shadow(false, has_window);
        EXPECT_LT(expected, 0.95) << has_window;
        EXPECT_NEAR(shadow(true, has_window), expected, 0.005) << has_window;
    }
}

TEST(PathIntegrator, BallBehindADescribedWallDoesNotDarkenTheTableBeforeIt) {
    SceneBuilder scene = table(path_settings(1));
    scene.add_mesh("wall", quad({-200, 20, 0}, {200, 20, 0}, {200, 20, 300}, {-200, 20, 300}),
                   diffuse(0.5f, 0.5f, 0.5f), ARHOST_ROLE_OCCLUDER);
    scene.add_ball("ball", {0, 60, 40, 30}, diffuse(0, 0, 0));
    const LinearPicture picture = rendered(std::move(scene), camera({0, -100, 60}, {0, 0, 0}, {0, 0, 1}));
    EXPECT_EQ(mean_at(picture, 100, 75, transmittance), 1);
}

// A table below a ball. The middle of the picture shows where the table mirrors the middle of the ball.
constexpr glm::vec4 mirrored_ball(0, 60, 60, 20);
SceneBuilder table_below_a_ball(const scene::Settings &settings, const arhost_material &of_table,
                                const arhost_material &of_ball, arhost_role role_of_table = ARHOST_ROLE_CATCHER) {
    SceneBuilder scene(settings);
    scene.add_mesh("table", square(2000), of_table, role_of_table);
    scene.add_ball("ball", mirrored_ball, of_ball);
    return scene;
}
constexpr double eye_y = -150, eye_z = 110, mirrored_y = eye_y + (60 - eye_y) * eye_z / (eye_z + 60);
arhost_camera at_the_mirrored_ball() {
    return camera({0, eye_y, eye_z}, {0, mirrored_y, 0}, {0, 0, 1});
}
// Reflectance of a dielectric of the index 1.5 where the middle of the picture shows the table.
double mirrored_share() {
    const double cosine = eye_z / std::hypot(mirrored_y - eye_y, eye_z);
    return 0.04 + 0.96 * std::pow(1 - cosine, 5);
}
arhost_material lacquer(float roughness, float albedo = 0.5f) {
    return metallic_roughness({albedo, albedo, albedo}, 0, roughness);
}
constexpr std::uint8_t video_code = 188;
// Mean of the picture over a grey video.
double composite_at(const LinearPicture &picture, std::uint32_t x, std::uint32_t y, int half = 2) {
    return mean_at(picture, x, y, 0, half) +
           mean_at(picture, x, y, transmittance, half) * shading::srgb_decode(video_code / 255.0);
}

TEST(PathIntegrator, LacqueredTableMirrorsAnEmissiveBall) {
    constexpr float radiance = 4;
    const auto render = [](const arhost_material &of_table, const char *light_samples) {
        SceneBuilder scene = table_below_a_ball(path_settings(), of_table, emissive(radiance));
        scene.add_light(sun(0.6f, 0, -0.8f));
        return rendered(std::move(scene), at_the_mirrored_ball(),
                        {{"samples", "64"}, {"light_samples", light_samples}});
    };
    for (const char *light_samples : {"1", "8"}) {
        const LinearPicture picture = render(lacquer(0), light_samples);
        const double expected = mirrored_share() * radiance;
        EXPECT_NEAR(mean_at(picture, 100, 75, 0), expected, 0.02 * expected);
        EXPECT_LT(picture.value(20, 75, 0), 1e-3) << "beside the mirrored ball";
        const LinearPicture matt = render(diffuse(0.5f, 0.5f, 0.5f), light_samples);
        EXPECT_EQ(matt.value(100, 75, 0), 0);
        EXPECT_EQ(matt.value(100, 75, transmittance), picture.value(100, 75, transmittance));
    }
}

TEST(PathIntegrator, BlackBallHidesTheMirroredSurroundings) {
    const arhost_camera view = at_the_mirrored_ball();
    const Video video(view.intrinsics, video_code);
    const auto render = [&](const arhost_material &of_table, const Video *under) {
        return rendered(table_below_a_ball(path_settings(1), of_table, diffuse(0, 0, 0)), view, {{"samples", "64"}},
                        0, under);
    };
    const LinearPicture matt = render(diffuse(0.5f, 0.5f, 0.5f), &video), picture = render(lacquer(0), &video);
    const double remaining = mean_at(matt, 100, 75, transmittance);
    EXPECT_NEAR(composite_at(picture, 100, 75),
                remaining * (shading::srgb_decode(video_code / 255.0) - mirrored_share()), 0.003);
    EXPECT_EQ(picture.value(100, 75, 0), 0);
    EXPECT_NEAR(composite_at(picture, 20, 75), composite_at(matt, 20, 75), 1e-3) << "beside the mirrored ball";
    const LinearPicture without_video = render(lacquer(0), nullptr);
    EXPECT_EQ(without_video.value(100, 75, 0), 0);
    EXPECT_EQ(without_video.value(100, 75, transmittance), matt.value(100, 75, transmittance));
}

TEST(PathIntegrator, GlossDoesNotChangeAFurnace) {
    const LinearPicture picture =
        rendered(table_below_a_ball(path_settings(1, 64), lacquer(0.3f, 1), diffuse(1, 1, 1)), at_the_mirrored_ball(),
                 {{"samples", "128"}});
    EXPECT_NEAR(mean_at(picture, 100, 75, 0, 8) + mean_at(picture, 100, 75, transmittance, 8), 1, 0.01);
}

// Returns a vertical square that faces the camera.
scene::TriangleMesh card(float y) {
    return quad({-60, y, 0}, {60, y, 0}, {60, y, 120}, {-60, y, 120});
}

// A lamp that the table mirrors without the ball is found by light samples and by scattered rays.
TEST(PathIntegrator, BallHidesTheHighlightOfALamp) {
    const arhost_camera view = at_the_mirrored_ball();
    const Video video(view.intrinsics, video_code);
    const auto render = [&](const char *light_samples, const char *samples, bool lamp_is_behind_a_wall) {
        SceneBuilder scene = table_below_a_ball(path_settings(0.2f), lacquer(0.3f), diffuse(0.5f, 0.5f, 0.5f));
        scene.add_light(bulb({0, 160, 130}, 40, 4000, ARHOST_FALLOFF_INVERSE_SQUARE));
        if (lamp_is_behind_a_wall)
            scene.add_mesh("wall", card(90), diffuse(0.5f, 0.5f, 0.5f), ARHOST_ROLE_OCCLUDER);
        return composite_at(rendered(std::move(scene), view,
                                     {{"light_samples", light_samples}, {"samples", samples}, {"max_radiance", "0"}},
                                     0, &video),
                            100, 75, 12);
    };
    for (const bool lamp_is_behind_a_wall : {false, true}) {
        const double few = render("1", "256", lamp_is_behind_a_wall),
                     many = render("16", "64", lamp_is_behind_a_wall);
        EXPECT_NEAR(few, many, 0.01 * many) << lamp_is_behind_a_wall;
    }
}

TEST(PathIntegrator, GlossyTableMirrorsNoBallBehindARealObject) {
    for (const float y : {90.0f, 30.0f}) {
        SceneBuilder scene = table_below_a_ball(path_settings(), lacquer(0.3f), emissive(4));
        scene.add_mesh("card", card(y), diffuse(0, 0, 0), ARHOST_ROLE_OCCLUDER);
        const LinearPicture picture = rendered(std::move(scene), at_the_mirrored_ball(), {{"light_samples", "8"}});
        const double mirrored = mean_at(picture, 100, 75, 0, 8);
        if (y > mirrored_ball.y)
            EXPECT_GT(mirrored, 0.1);
        else
            EXPECT_EQ(mirrored, 0);
    }
}

// Rays of the gloss do not see lamps in mirrors and glass; photons bring their light.
TEST(PathIntegrator, GlossyCatcherMirrorsTheLightOfMirrorsAndGlassAsAVirtualObject) {
    for (const arhost_material &of_ball : {mirror(0.9f), glass_of()}) {
        const auto render = [&](const arhost_material &ball, arhost_role role_of_table) {
            SceneBuilder scene = table_below_a_ball(path_settings(), metallic_roughness({0.9f, 0.9f, 0.9f}, 1, 0.4f),
                                                    ball, role_of_table);
            scene.add_light(bulb({0, -200, 150}, 20, 50000, ARHOST_FALLOFF_INVERSE_SQUARE));
            return mean_at(
                rendered(std::move(scene), at_the_mirrored_ball(), {{"samples", "16"}, {"photons", "32768"}}), 100,
                75, 0, 12);
        };
        const double expected = render(of_ball, ARHOST_ROLE_VIRTUAL) - render(diffuse(0, 0, 0), ARHOST_ROLE_VIRTUAL);
        EXPECT_GT(expected, 0.01);
        EXPECT_NEAR(render(of_ball, ARHOST_ROLE_CATCHER), expected, 0.05 * expected);
    }
}

// The video cannot show how bright the highlight of a lamp is.
TEST(PathIntegrator, TableBelowAHiddenSaturatedHighlightKeepsItsColour) {
    const arhost_camera view = at_the_mirrored_ball();
    const Video video(view.intrinsics, 255);
    const auto render = [&](const arhost_material &of_table, arhost_role role_of_table) {
        SceneBuilder scene = table_below_a_ball(path_settings(), of_table, diffuse(0, 0, 0), role_of_table);
        scene.add_light(bulb({0, 160, 130}, 30, 30000, ARHOST_FALLOFF_INVERSE_SQUARE)); // behind the ball
        scene.add_light(sun(0.6f, 0, -0.8f));
        return rendered(std::move(scene), view, {}, 0, &video);
    };
    const double matt = mean_at(render(lacquer(0.1f), ARHOST_ROLE_VIRTUAL), 100, 75, 0);
    const LinearPicture picture = render(lacquer(0.1f), ARHOST_ROLE_CATCHER);
    EXPECT_GT(matt, 0.1);
    EXPECT_NEAR(mean_at(picture, 100, 75, transmittance), matt, 0.03 * matt);
}

TEST(PathIntegrator, RealMetalHasNoShadow) {
    for (const float metallic : {1.0f, 0.999f}) {
        SceneBuilder scene = table_below_a_ball(
            path_settings(), metallic_roughness({0.9f, 0.9f, 0.9f}, metallic, 0.2f), diffuse(0, 0, 0));
        scene.add_light(bulb({0, 60, 200}, 10, 30000, ARHOST_FALLOFF_INVERSE_SQUARE)); // above the ball
        const LinearPicture picture = rendered(std::move(scene), camera({0, 55, 400}, {0, 60, 0}, {0, 1, 0}));
        EXPECT_NEAR(mean_at(picture, 100, 55, transmittance), 1, 0.01);
    }
}

// The kernel reads the records of at most 16 lamps in another way than those of more.
TEST(PathIntegrator, SeventeenLampsShineLikeSixteen) {
    const auto render = [](int lamps, const char *instruction_set) {
        SceneBuilder scene(path_settings());
        scene.add_mesh("floor", square(100), diffuse(0.5f, 0.5f, 0.5f));
        for (int i = 0; i < lamps; ++i) {
            const double angle = 0.3 * i;
            const float x = 60 * static_cast<float>(std::cos(angle)), y = 60 * static_cast<float>(std::sin(angle));
            scene.add_light(
                light(x, y, 50, i < 16 ? 100 * static_cast<float>(i) : 1e-3f, ARHOST_FALLOFF_INVERSE_SQUARE));
        }
        return rendered(std::move(scene), from_above(), {{"samples", "16"}, {"instruction_set", instruction_set}});
    };
    for (const int lamps : {16, 17})
        EXPECT_EQ(render(lamps, "base").pixels(), render(lamps, "auto").pixels());
    const LinearPicture few = render(16, "auto"), many = render(17, "auto");
    for (const std::uint32_t x : {60u, 100u, 140u})
        EXPECT_NEAR(mean_at(many, x, 75, 0, 10), mean_at(few, x, 75, 0, 10), 0.02 * mean_at(few, x, 75, 0, 10)) << x;
}

TEST(PathIntegrator, EnvironmentFollowsTheVideo) {
    const auto make = [] {
        SceneBuilder scene = table(path_settings());
        add_environment(scene, [](std::uint32_t) { return glm::vec3(2); });
        scene.environment.follows_video = true;
        scene.add_ball("ball", {0, 0, 40, 30}, diffuse(1, 1, 1));
        return scene;
    };
    const arhost_camera view = from_above();
    const Video video(view.intrinsics);
    const LinearPicture lit = rendered(make(), view, {{"samples", "64"}}, 0, &video),
                        unknown = rendered(make(), view, {{"samples", "64"}});
    raytracer_common::VideoImage image;
    image.set(video.frame());
    const std::array<float, 3> mean = image.mean();
    const double luminance = 0.2126 * double{mean[0]} + 0.7152 * double{mean[1]} + 0.0722 * double{mean[2]};
    for (std::size_t c = 0; c < 3; ++c) {
        const double expected = mean_at(unknown, 100, 75, c, 8) * (double{mean[c]} + luminance) / 2 / 0.18;
        EXPECT_NEAR(mean_at(lit, 100, 75, c, 8), expected, 0.01 * expected) << c;
    }
    EXPECT_LT(mean_at(lit, 60, 75, transmittance, 4), 0.9) << "the shadow does not depend on the colour";
}

// Where only virtual objects emit light, the brightness of the room is known from its video only.
TEST(PathIntegrator, EmissiveBallLightsACatcherOfTheFilmedRoom) {
    constexpr double radius = 15, height = 50, radiance = 4, reflectance = 0.35;
    const arhost_camera view = from_above();
    const Video video(view.intrinsics);
    raytracer_common::VideoImage image;
    image.set(video.frame());
    const std::array<float, 3> mean = image.mean();
    const double of_room = (double{mean[0]} + mean[1] + mean[2]) / 3 / reflectance;
    const double distance = on_the_floor(60, 75).x, squared = distance * distance + height * height;
    const double form_factor = radius * radius / squared * height / std::sqrt(squared);
    // Light samples do not choose balls that share a geometry; scattered rays find them.
    const glm::vec4 ball(0, 0, height, radius), inner(0, 0, height, radius / 2);
    for (const scene::Spheres &balls : {scene::Spheres{ball}, scene::Spheres{ball, inner}}) {
        SceneBuilder scene = table(path_settings());
        scene.add_object("ball", scene.add_spheres(balls), scene.add_material(emissive(radiance)));
        const LinearPicture picture = rendered(std::move(scene), view, {{"samples", "256"}}, 0, &video);
        EXPECT_NEAR(mean_at(picture, 60, 75, transmittance), 1 + radiance * form_factor / of_room, 0.02)
            << balls.size();
    }
}

// A tile with many samples or lamps takes many seconds.
TEST(PathIntegrator, CanBeCancelledWithinATile) {
    SceneBuilder scene = table(path_settings(1));
    scene.add_ball("ball", {0, 0, 40, 30}, diffuse(1, 1, 1));
    const arhost_camera view = camera({0, 0, 200}, {0, 0, 0}, {0, 1, 0}, pinhole(32, 32, 32));
    Tracer tracer(std::move(scene), {{"samples", "64"}});
    ASSERT_EQ(tracer.start(view.intrinsics), ARHOST_STATUS_OK);
    tracer.plugin().cancel(10);
    Picture picture(view.intrinsics);
    EXPECT_EQ(tracer.try_render(view, picture), ARHOST_STATUS_ERROR_CANCELLED);
    EXPECT_LT(tracer.plugin().cancel_checks(), 20);
}

TEST(PathIntegrator, MeanOfOneSampleFramesIsTheConvergedImage) {
    const auto make = [] {
        SceneBuilder scene = table(path_settings(0.5f));
        scene.add_light(bulb({60, 0, 120}, 20, 1));
        scene.add_ball("ball", {0, 0, 30, 20}, diffuse(0.8f, 0.8f, 0.8f));
        return scene;
    };
    const arhost_camera view = camera({0, 0, 200}, {0, 0, 0}, {0, 1, 0}, pinhole(40, 30, 40));
    const LinearPicture converged = rendered(make(), view, {{"samples", "256"}});
    LinearTracer tracer(make(), {}, "rt_embree");
    ASSERT_EQ(tracer.start(view.intrinsics), ARHOST_STATUS_OK);
    std::array<double, 8> sum{}, expected{};
    std::vector<double> mean(std::size_t{40} * 30 * 8);
    for (std::uint64_t frame = 0; frame < 256; ++frame) {
        const LinearPicture one = tracer.render(view, frame);
        for (std::uint32_t i = 0; i < 40 * 30; ++i)
            for (std::size_t c = 0; c < 8; ++c)
                mean[8 * i + c] += one.value(i % 40, i / 40, c) / 256;
    }
    double worst = 0;
    for (std::uint32_t i = 0; i < 40 * 30; ++i)
        for (std::size_t c = 0; c < 8; ++c) {
            const double other = converged.value(i % 40, i / 40, c);
            sum[c] += mean[8 * i + c];
            expected[c] += other;
            worst = std::max(worst, std::abs(mean[8 * i + c] - other));
        }
    for (std::size_t c = 0; c < 8; ++c)
        EXPECT_NEAR(sum[c], expected[c], 0.003 * 40 * 30) << c;
    EXPECT_LT(worst, 0.12);
}

TEST(PathIntegrator, ErrorsOfNeighboursCancel) {
    const auto make = [] {
        SceneBuilder scene(path_settings());
        scene.add_light(bulb({60, 0, 120}, 60, 1));
        scene.add_mesh("floor", square(2000), diffuse(0.8f, 0.8f, 0.8f));
        return scene;
    };
    constexpr std::uint32_t side = 64, square_side = 4;
    const arhost_camera view = camera({0, 0, 200}, {0, 0, 0}, {0, 1, 0}, pinhole(side, side, 60));
    const LinearPicture converged = rendered(make(), view, {{"samples", "256"}});
    const LinearPicture noisy = rendered(make(), view, {{"samples", "1"}});
    double squares_of_pixels = 0, squares_of_means = 0;
    for (std::uint32_t y = 0; y < side; y += square_side)
        for (std::uint32_t x = 0; x < side; x += square_side) {
            double mean = 0;
            for (std::uint32_t i = 0; i < square_side * square_side; ++i) {
                const std::uint32_t column = x + i % square_side, row = y + i / square_side;
                const double error = noisy.value(column, row, 0) - converged.value(column, row, 0);
                mean += error / (square_side * square_side);
                squares_of_pixels += error * error / (square_side * square_side);
            }
            squares_of_means += mean * mean;
        }
    ASSERT_GT(squares_of_pixels, 0);
    const double of_independent_pixels = 1.0 / square_side;
    EXPECT_LT(std::sqrt(squares_of_means / squares_of_pixels), 0.6 * of_independent_pixels);
}

TEST(PathIntegrator, EqualRequestsGiveEqualBytes) {
    const auto make = [] {
        SceneBuilder scene = table(path_settings(0.3f));
        scene.add_light(bulb({60, 0, 120}, 20, 1));
        scene.add_ball("ball", {-30, 0, 30, 20}, glass_of());
        scene.add_ball("metal", {30, 0, 30, 20}, metallic_roughness({1, 0.8f, 0.4f}, 1, 0.3f));
        scene.add_ball("lamp", {0, 30, 10, 5}, emissive(3));
        return scene;
    };
    const LinearPicture one = rendered(make(), from_the_side(), {{"threads", "1"}, {"samples", "2"}}, 7);
    EXPECT_EQ(one.pixels(), rendered(make(), from_the_side(), {{"threads", "3"}, {"samples", "2"}}, 7).pixels());
    EXPECT_EQ(one.pixels(),
              rendered(make(), from_the_side(), {{"instruction_set", "base"}, {"samples", "2"}}, 7).pixels());
    EXPECT_NE(one.pixels(), rendered(make(), from_the_side(), {{"samples", "2"}}, 8).pixels());
}

TEST(PathIntegrator, RejectsLinearImagesOfWhittedScenes) {
    SceneBuilder scene;
    scene.add_ball("ball", {0, 0, 0, 40}, diffuse(1, 1, 1));
    LinearTracer tracer(std::move(scene), {}, "rt_embree");
    EXPECT_EQ(tracer.start(pinhole()), ARHOST_STATUS_ERROR_INVALID_ARGUMENT);
}

TEST(PathIntegrator, AlphaOfStraightImagesRemovesTheSameLight) {
    const auto make = [] {
        SceneBuilder scene = table(path_settings(1));
        scene.add_ball("ball", {0, 0, 40, 20}, diffuse(0.2f, 0.2f, 0.2f));
        return scene;
    };
    const LinearPicture linear = rendered(make(), from_above());
    Tracer tracer(make(), {{"samples", "64"}});
    const Picture straight = tracer.render(from_above());
    for (std::uint32_t x = 0; x < 200; ++x) {
        const double removed =
            shading::overlay_alpha({linear.value(x, 75, 4), linear.value(x, 75, 5), linear.value(x, 75, 6)});
        const double alpha = shading::alpha_of_light(1 - removed); // Tracer requests images for blending in sRGB
        EXPECT_NEAR(straight.alpha(x, 75), 255 * alpha, 1) << x;
    }
    EXPECT_TRUE(is_code_of(straight.at(100, 75)[0], linear.value(100, 75, 0), 2e-3));
}

struct OddScene {
    const char *name;
    void (*add)(SceneBuilder &scene);
};
// An environment of one colour except for its first texel.
void add_sky(SceneBuilder &scene, std::uint32_t width, std::uint32_t height, float radiance, float sun) {
    std::vector<glm::vec4> texels(std::size_t{width} * height, glm::vec4(glm::vec3(radiance), 1));
    texels[0] = glm::vec4(glm::vec3(sun), 1);
    scene::TexelImage texture = float_texture_of(width, height, texels);
    scene::Environment environment;
    scene::add_cumulative_sums(environment, texture, scene::Reporter({}, "sky"));
    environment.texture = scene.add_texture("sky", std::move(texture), {.wrap_v = ARHOST_WRAP_CLAMP});
    scene.environment = std::move(environment);
    scene.add_ball("ball", {0, 0, 20, 20}, glass_of());
    scene.add_ball("metal", {50, 0, 20, 20}, metallic_roughness({1, 1, 1}, 1, 0));
    scene.add_mesh("table", square(500), diffuse(1, 1, 1), ARHOST_ROLE_CATCHER);
}

class OddPathScene : public testing::TestWithParam<OddScene> {};

TEST_P(OddPathScene, HasFiniteNonNegativePixels) {
    SceneBuilder scene(path_settings());
    GetParam().add(scene);
    const LinearPicture picture = rendered(std::move(scene), from_the_side(pinhole(60, 45, 60)), {{"samples", "4"}});
    for (const LinearPixel &pixel : picture.pixels())
        for (const std::uint16_t half : pixel)
            ASSERT_LT(half, 0x7c00) << "negative, infinite or NaN";
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, OddPathScene,
    testing::Values(
        OddScene{"Empty", [](SceneBuilder &) {}},
        OddScene{"NoLight",
                 [](SceneBuilder &scene) {
                     scene.add_ball("ball", {0, 0, 0, 20}, glass_of());
                 }},
        OddScene{"EnvironmentOfOnePixel", [](SceneBuilder &scene) { add_sky(scene, 1, 1, 0, 2); }},
        OddScene{"BlackEnvironment", [](SceneBuilder &scene) { add_sky(scene, 8, 4, 0, 0); }},
        OddScene{"SunOfAMillion", [](SceneBuilder &scene) { add_sky(scene, 64, 32, 0.1f, 1e6f); }},
        OddScene{"ThousandsOfLamps",
                 [](SceneBuilder &scene) {
                     for (int i = 0; i < 3000; ++i)
                         scene.add_light(bulb({i % 50 * 10 - 250, i / 50 * 10 - 300, 200}, 2, 0.001f));
                     scene.add_ball("ball", {0, 0, 20, 20}, glass_of());
                     scene.add_mesh("table", square(500), diffuse(1, 1, 1), ARHOST_ROLE_CATCHER);
                 }},
        OddScene{"EmissiveTrianglesWithoutArea",
                 [](SceneBuilder &scene) {
                     scene.add_mesh("lamp", quad({0, 0, 0}, {10, 0, 0}, {20, 0, 0}, {30, 0, 0}), emissive(1));
                     scene.add_mesh("table", square(500), diffuse(1, 1, 1), ARHOST_ROLE_CATCHER);
                     scene.add_ball("ball", {0, 0, 20, 20}, diffuse(1, 1, 1));
                 }},
        OddScene{"CatcherWithoutArea",
                 [](SceneBuilder &scene) {
                     scene.add_mesh("table", quad({0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}), diffuse(1, 1, 1),
                                    ARHOST_ROLE_CATCHER);
                     scene.add_ball("ball", {0, 0, 20, 20}, diffuse(1, 1, 1));
                     scene.add_light(sun());
                 }},
        OddScene{"LampInsideABall",
                 [](SceneBuilder &scene) {
                     scene.add_ball("ball", {0, 0, 20, 20}, glass_of());
                     scene.add_light(bulb({0, 0, 20}, 5, 1e6f, ARHOST_FALLOFF_INVERSE_SQUARE));
                     scene.add_mesh("table", square(500), diffuse(1, 1, 1), ARHOST_ROLE_CATCHER);
                 }},
        OddScene{"RoughestGlass",
                 [](SceneBuilder &scene) {
                     scene.add_mesh("table", square(500), diffuse(1, 1, 1), ARHOST_ROLE_CATCHER);
                     scene.add_ball("ball", {0, 0, 20, 20}, glass_of(4, 1));
                     scene.add_mesh("box", moved(cube(10), {40, 0, 11}), glass_of(1, 1));
                     scene.add_light(bulb({0, 0, 100}, 20, 1));
                 }},
        OddScene{"HugeEmission",
                 [](SceneBuilder &scene) {
                     scene.add_ball("ball", {0, 0, 20, 20}, emissive(1e6f));
                     scene.add_mesh("table", square(500), diffuse(1, 1, 1), ARHOST_ROLE_CATCHER);
                     scene.add_light(sun());
                 }},
        OddScene{"HugeEmissionInARealMirror",
                 [](SceneBuilder &scene) {
                     scene.add_ball("ball", {0, 0, 30, 20}, emissive(1e6f));
                     scene.add_mesh("mirror", square(500), metallic_roughness({1, 1, 1}, 1, 0), ARHOST_ROLE_CATCHER);
                     scene.add_light(bulb({0, 100, 100}, 20, 1e6f));
                 }},
        OddScene{"DistantWallThatCatchesPhotons", // one cell then holds all photons near the table
                 [](SceneBuilder &scene) {
                     const float far = 1e8f;
                     scene.add_light(placed(ARHOST_LIGHT_POINT, {-100, 0, 200}, 1e4f, ARHOST_FALLOFF_INVERSE_SQUARE));
                     scene.add_ball("ball", {0, 0, 25, 20}, mirror(1));
                     scene.add_mesh("table", square(500), diffuse(1, 1, 1), ARHOST_ROLE_CATCHER);
                     scene.add_mesh("wall",
                                    quad({-far, -far, -far}, {-far, far, -far}, {-far, far, far}, {-far, -far, far}),
                                    diffuse(0.5f, 0.5f, 0.5f));
                 }},
        OddScene{"HugeCoordinates",
                 [](SceneBuilder &scene) {
                     scene.add_ball("far", {1e9f, 1e9f, 1e9f, 1e8f}, mirror(1));
                     scene.add_ball("ball", {0, 0, 20, 20}, diffuse(1, 1, 1));
                     scene.add_mesh("table", square(1e9f), diffuse(1, 1, 1), ARHOST_ROLE_CATCHER);
                     scene.add_light(light(0, 0, 1e9f, 1));
                 }}),
    [](const auto &info) { return std::string(info.param.name); });

} // namespace
} // namespace arhost::test
