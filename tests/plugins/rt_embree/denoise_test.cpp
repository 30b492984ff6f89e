// SPDX-License-Identifier: Apache-2.0
//
// The option `quality`: few samples with the light of earlier frames, compared with converged pictures.
#include "still_life.hpp"

#include <array>
#include <cmath>
#include <functional>
#include <set>

namespace arhost::test {
namespace {

constexpr std::uint32_t width = 200, height = 150; // of pinhole()
const Options noisy{{"samples", "1"}}, denoised{{"quality", "realtime"}}, converged{{"samples", "256"}};

LinearPicture picture_of(SceneBuilder scene, const Options &options, const arhost_camera &view,
                         std::optional<double> time_s = {}, const Video *video = nullptr) {
    LinearTracer tracer(std::move(scene), options, "rt_embree");
    EXPECT_EQ(tracer.start(view.intrinsics, video), ARHOST_STATUS_OK) << tracer.log();
    return tracer.render(view, 0, video, time_s);
}

class Denoising : public testing::Test {
protected:
    explicit Denoising(const Options &options = denoised) : tracer_(still_life(), options, "rt_embree") {
        EXPECT_EQ(tracer_.start(pinhole()), ARHOST_STATUS_OK) << tracer_.log();
    }
    LinearPicture next(double degrees) { return tracer_.render(turned(degrees), number_++); }
    void expect_to_follow_the_camera() {
        for (int i = 0; i < 11; ++i)
            next(0.7 * i);
        const LinearPicture truth = picture_of(still_life(), converged, turned(0.7 * 11));
        const double noise = difference(picture_of(still_life(), noisy, turned(0.7 * 11)), truth);
        EXPECT_LT(difference(next(0.7 * 11), truth), 0.25 * noise);
    }

    LinearTracer tracer_;
    std::uint64_t number_ = 0;
};

TEST_F(Denoising, ConvergesWhileTheCameraRests) {
    const LinearPicture truth = picture_of(still_life(), converged, turned(0));
    const double noise = difference(picture_of(still_life(), noisy, turned(0)), truth);
    EXPECT_LT(difference(next(0), truth), 0.6 * noise);
    for (int i = 0; i < 30; ++i)
        next(0);
    EXPECT_LT(difference(next(0), truth), 0.2 * noise);
}

TEST(DenoisingOfMirrors, ConvergesWhileTheCameraRests) {
    LinearTracer tracer(with_mirror_and_glass(), denoised, "rt_embree");
    ASSERT_EQ(tracer.start(pinhole()), ARHOST_STATUS_OK) << tracer.log();
    const LinearPicture truth = picture_of(with_mirror_and_glass(), converged, turned(0)),
                        other = picture_of(still_life(), converged, turned(0));
    const auto shows_them = [&](std::uint32_t x, std::uint32_t y) {
        return truth.value(x, y, 4) == 0 && other.value(x, y, 4) > 0;
    };
    const double noise = difference(picture_of(with_mirror_and_glass(), noisy, turned(0)), truth, shows_them);
    LinearPicture picture = tracer.render(turned(0), 0);
    EXPECT_LT(difference(picture, truth, shows_them), 0.7 * noise);
    for (std::uint64_t i = 1; i < 16; ++i)
        picture = tracer.render(turned(0), i);
    EXPECT_LT(difference(picture, truth, shows_them), 0.3 * noise);
}

// Mirrors and glass that show each other, and what they show when nothing or the camera moves.
struct Seen {
    const char *name;
    void (*add)(SceneBuilder &scene);
    double degrees_per_frame;
};
void add_second_mirror(SceneBuilder &scene) {
    scene.add_mesh("second", quad({80, -60, 0}, {-80, -60, 0}, {-80, -60, 30}, {80, -60, 30}), mirror(0.9f));
}
void add_glass(SceneBuilder &scene) {
    scene.add_ball("glass", {0, 20, 30, 30}, glass_of());
}
void add_metal(SceneBuilder &scene) {
    arhost_material metal = scene::make_material(ARHOST_MATERIAL_METAL);
    set3(metal.diffuse, 0.4f, 0.4f, 0.4f);
    set3(metal.reflectivity, 0.5f, 0.5f, 0.5f);
    scene.add_ball("metal", {0, 20, 30, 30}, metal);
}
class DenoisingOfWhatIsSeen : public testing::TestWithParam<Seen> {};
INSTANTIATE_TEST_SUITE_P(Objects, DenoisingOfWhatIsSeen,
                         testing::Values(Seen{"MirrorsAtRest", add_second_mirror, 0},
                                         Seen{"MirrorsInMotion", add_second_mirror, 0.7},
                                         Seen{"GlassAtRest", add_glass, 0}, Seen{"GlassInMotion", add_glass, 0.7},
                                         Seen{"MetalAtRest", add_metal, 0}, Seen{"MetalInMotion", add_metal, 0.7}),
                         [](const auto &info) { return std::string(info.param.name); });

TEST_P(DenoisingOfWhatIsSeen, LosesNoLight) {
    const auto make = [] {
        SceneBuilder scene = still_life();
        scene.add_mesh("mirror", quad({-80, 80, 1}, {80, 80, 1}, {80, 80, 100}, {-80, 80, 100}), mirror(0.9f));
        GetParam().add(scene);
        return scene;
    };
    LinearTracer tracer(make(), denoised, "rt_embree");
    ASSERT_EQ(tracer.start(pinhole()), ARHOST_STATUS_OK) << tracer.log();
    constexpr int frames = 12;
    LinearPicture picture = tracer.render(turned(0), 0);
    for (int i = 1; i < frames; ++i)
        picture = tracer.render(turned(GetParam().degrees_per_frame * i), static_cast<std::uint64_t>(i));
    const LinearPicture truth = picture_of(make(), converged, turned(GetParam().degrees_per_frame * (frames - 1)));
    double light = 0, expected = 0;
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x)
            if (truth.value(x, y, 4) == 0) {
                light += std::min(double{picture.value(x, y, 1)}, 4.0);
                expected += std::min(double{truth.value(x, y, 1)}, 4.0);
            }
    ASSERT_GT(expected, 100);
    EXPECT_NEAR(light / expected, 1, 0.03); // fireflies are bounded
}

// The light that a shelf and the table below it send to each other stays in proportion to that of the surroundings,
// also if this is much weaker than the video.
TEST(DenoisingOfFilmedSurfaces, LightDoesNotGrowFromFrameToFrame) {
    const auto make = [] {
        SceneBuilder scene(path_traced(0.04f));
        scene.add_mesh("table", square(2000), diffuse(0.8f, 0.8f, 0.8f), ARHOST_ROLE_CATCHER);
        scene.add_mesh("shelf", quad({-60, -40, 14}, {60, -40, 14}, {60, 60, 14}, {-60, 60, 14}),
                       diffuse(0.9f, 0.9f, 0.9f));
        return scene;
    };
    const arhost_camera view = camera({0, -220, 30}, {0, 0, 5}, {0, 0, 1});
    const Video video(view.intrinsics, 230);
    const LinearPicture truth = picture_of(make(), converged, view, {}, &video);
    LinearTracer tracer(make(), denoised, "rt_embree");
    ASSERT_EQ(tracer.start(view.intrinsics, &video), ARHOST_STATUS_OK) << tracer.log();
    constexpr std::uint64_t frames = 60;
    LinearPicture picture = tracer.render(view, 0, &video);
    for (std::uint64_t i = 1; i < frames; ++i)
        picture = tracer.render(view, i, &video);
    double light = 0, expected = 0; // of the table
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) {
            light += double{picture.value(x, y, 5)};
            expected += double{truth.value(x, y, 5)};
        }
    EXPECT_NEAR(light / expected, 1, 0.1); // fireflies are bounded
}

// The table mirrors the objects, and not what they cover.
TEST(DenoisingOfGloss, ConvergesWhileTheCameraRests) {
    const auto make = [] { return still_life(metallic_roughness({0.2f, 0.2f, 0.2f}, 0, 0.15f)); };
    const arhost_camera view = camera({0, -220, 70}, {0, 0, 10}, {0, 0, 1});
    const Video video(view.intrinsics, 140);
    LinearTracer tracer(make(), denoised, "rt_embree");
    ASSERT_EQ(tracer.start(view.intrinsics, &video), ARHOST_STATUS_OK) << tracer.log();
    const LinearPicture truth = picture_of(make(), converged, view, {}, &video),
                        matt = picture_of(still_life(), converged, view, {}, &video);
    const auto shows_table = [&](std::uint32_t x, std::uint32_t y) { return truth.value(x, y, 4) > 0.2f; };
    const double noise = difference(picture_of(make(), noisy, view, {}, &video), truth, shows_table),
                 gloss = difference(matt, truth, shows_table);
    LinearPicture picture = tracer.render(view, 0, &video);
    for (std::uint64_t i = 1; i < 32; ++i)
        picture = tracer.render(view, i, &video);
    EXPECT_LT(difference(picture, truth, shows_table), 0.25 * noise);
    EXPECT_LT(difference(picture, truth, shows_table), 0.4 * gloss);
}

TEST_F(Denoising, FollowsTheCamera) {
    expect_to_follow_the_camera();
}

// A tracer that takes four times as long as a frame of the video.
TEST_F(Denoising, ConvergesIfFramesAreMissing) {
    const LinearPicture truth = picture_of(still_life(), converged, turned(0));
    const double noise = difference(picture_of(still_life(), noisy, turned(0)), truth);
    for (int i = 0; i < 31; ++i, number_ += 3)
        next(0);
    EXPECT_LT(difference(next(0), truth), 0.2 * noise);
}

TEST_F(Denoising, RendersImagesOfAnySize) {
    for (const auto &[w, h] : {std::pair{1u, 1u}, {1u, 40u}, {50u, 1u}, {17u, 5u}, {65u, 33u}}) {
        LinearTracer tracer(still_life(), denoised, "rt_embree");
        arhost_camera view = turned(0);
        view.intrinsics = pinhole(w, h, w);
        ASSERT_EQ(tracer.start(view.intrinsics), ARHOST_STATUS_OK) << tracer.log();
        for (std::uint64_t i = 0; i < 5; ++i)
            tracer.render(view, i);
    }
}

TEST_F(Denoising, SmoothsEdges) {
    std::set<std::uint16_t> shares; // of the table, where it ends at a ball
    for (int i = 0; i < 15; ++i)
        next(0);
    const LinearPicture picture = next(0), truth = picture_of(still_life(), converged, turned(0));
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) {
            const float expected = truth.value(x, y, 4), share = picture.value(x, y, 4);
            if (expected > 0 && expected < 0.5f && truth.value(x, y, 0) > 0)
                shares.insert(picture.at(x, y)[4]);
            if (expected == 0 || share == 0) {
                EXPECT_NEAR(share, expected, 0.25) << x << ", " << y;
            }
        }
    EXPECT_GT(shares.size(), 20u);
}

TEST_F(Denoising, LeavesOtherPixelsUntouched) {
    for (int i = 0; i < 3; ++i)
        next(0);
    const LinearPicture picture = next(0);
    EXPECT_EQ(picture.at(width / 2, 2), untouched); // above the table's end
    EXPECT_EQ(picture.info.has_region, 1);
}

TEST_F(Denoising, ImagesDependOnTheRequestOnly) {
    const std::array<Options, 3> variants{{{{"quality", "realtime"}, {"threads", "1"}},
                                           {{"quality", "realtime"}, {"threads", "3"}},
                                           {{"quality", "realtime"}, {"instruction_set", "base"}}}};
    const Video video(pinhole());
    for (const arhost_material &of_table :
         {diffuse(0.4f, 0.4f, 0.4f), metallic_roughness({0.2f, 0.2f, 0.2f}, 0, 0.15f)}) {
        std::vector<std::unique_ptr<LinearTracer>> tracers;
        for (const Options &options : variants) {
            tracers.push_back(std::make_unique<LinearTracer>(with_mirror_and_glass(of_table), options, "rt_embree"));
            ASSERT_EQ(tracers.back()->start(pinhole(), &video), ARHOST_STATUS_OK);
        }
        for (std::uint64_t frame = 0; frame < 6; ++frame) {
            const arhost_camera view = turned(0.5 * static_cast<double>(frame));
            for (const auto &tracer : tracers)
                tracer->shading_px = frame < 3 ? 1 : 2;
            const LinearPicture expected = tracers[0]->render(view, frame, &video);
            for (std::size_t i = 1; i < tracers.size(); ++i) {
                EXPECT_EQ(tracers[i]->render(view, frame, &video).pixels(), expected.pixels())
                    << frame << ", variant " << i;
                EXPECT_TRUE(std::ranges::equal(tracers[i]->state(), tracers[0]->state()))
                    << frame << ", variant " << i;
            }
        }
    }
}

// The other one has kept what it knows of a scene at rest.
TEST(DenoisingOfMirrors, ANewWorkerRendersTheSameImage) {
    LinearTracer old(with_mirror_and_glass(), denoised, "rt_embree"),
        fresh(with_mirror_and_glass(), denoised, "rt_embree");
    ASSERT_EQ(old.start(pinhole()), ARHOST_STATUS_OK) << old.log();
    ASSERT_EQ(fresh.start(pinhole()), ARHOST_STATUS_OK) << fresh.log();
    for (std::uint64_t i = 0; i < 20; ++i) {
        old.shading_px = i % 2 == 0 ? 1 : 2; // a setting of each image, not of later ones
        old.render(turned(0), i);
    }
    fresh.render(turned(0), 0);
    for (const std::uint32_t shading_px : {0u, 2u}) {
        std::ranges::copy(old.state(), fresh.state().begin());
        fresh.shading_px = old.shading_px = shading_px;
        EXPECT_EQ(fresh.render(turned(0), 20).pixels(), old.render(turned(0), 20).pixels()) << shading_px;
        EXPECT_TRUE(std::ranges::equal(fresh.state(), old.state())) << shading_px;
    }
}

TEST_F(Denoising, IgnoresAStateOfAnotherVersionOrSize) {
    const LinearPicture first = next(0);
    for (const std::size_t field : {0u, 4u, 8u}) { // version, width, height
        number_ = 0;
        ++reinterpret_cast<unsigned char *>(tracer_.state().data())[field];
        EXPECT_EQ(next(0).pixels(), first.pixels()) << field;
    }
}

TEST(DenoisingOfStraightImages, RejectsAStateThatIsTooSmall) {
    Tracer tracer(still_life(), denoised, "rt_embree");
    ASSERT_EQ(tracer.start(pinhole()), ARHOST_STATUS_OK) << tracer.log();
    std::array<std::byte, 64> state;
    arhost_render_request request{};
    request.struct_size = sizeof request;
    request.camera = turned(0);
    request.state_after = state.data();
    request.state_size = state.size();
    Picture picture(pinhole());
    const arhost_image image = picture.image();
    EXPECT_EQ(tracer.plugin().functions<arhost_raytracer>().render(tracer.plugin().instance(), &request, &image,
                                                                   &picture.info),
              ARHOST_STATUS_ERROR_INVALID_ARGUMENT);
    EXPECT_THAT(tracer.log(), testing::HasSubstr("the state has 64 bytes; the host must provide"));
}

TEST(Quality, DeterminesSamplesAndDenoising) {
    struct Case {
        Options options;
        std::uint32_t samples;
        bool denoises;
    };
    for (const auto &[options, samples, denoises] :
         {Case{{{"quality", "realtime"}, {"samples", "0"}}, 1, true},
          Case{{{"quality", "balanced"}, {"samples", "0"}}, 4, true},
          Case{{{"quality", "reference"}, {"samples", "0"}}, 64, false},
          Case{{{"quality", "balanced"}, {"samples", "3"}}, 3, true},
          Case{{{"quality", "realtime"}, {"samples", "0"}, {"accumulate", "true"}}, 1, false}}) {
        LinearTracer tracer(still_life(), options, "rt_embree");
        arhost_camera view = turned(0);
        view.intrinsics = pinhole(16, 8, 16);
        ASSERT_EQ(tracer.start(view.intrinsics), ARHOST_STATUS_OK) << tracer.log();
        const arhost_render_info info = tracer.render(view, 0).info;
        EXPECT_EQ(info.full_samples, samples);
        EXPECT_EQ(info.coarsest_shading_px, denoises ? 2u : 0u);
        EXPECT_EQ(!tracer.state().empty(), denoises) << samples;
    }
}

// A mirror shows a part of the table that an earlier picture showed, and later less of it.
TEST(Surroundings, StayVisibleInMirrors) {
    const auto make = [] {
        SceneBuilder scene(path_traced(0.4f));
        scene.add_mesh("table", square(1000), diffuse(0.02f, 0.02f, 0.02f), ARHOST_ROLE_CATCHER);
        scene.add_mesh("mirror", quad({-80, 100, 1}, {80, 100, 1}, {80, 100, 100}, {-80, 100, 100}), mirror(1));
        return scene;
    };
    constexpr std::uint8_t code = 200;
    constexpr double of_video = 0.578, of_table = 0.02 * 0.4; // linear light
    const arhost_camera far = camera({0, -400, 400}, {0, -100, 0}, {0, 0, 1}),
                        near = camera({0, -60, 60}, {0, 100, 50}, {0, 0, 1});
    const Video video(far.intrinsics, code);
    // Of the table behind the near camera, 180 mm from the mirror.
    const auto mirrored = [](const LinearPicture &picture) {
        double sum = 0;
        for (std::uint32_t x = width / 2 - 5; x < width / 2 + 5; ++x)
            sum += double{picture.value(x, height / 2 + 11, 1)};
        return sum / 10;
    };
    LinearTracer tracer(make(), denoised, "rt_embree");
    ASSERT_EQ(tracer.start(far.intrinsics, &video), ARHOST_STATUS_OK) << tracer.log();
    EXPECT_NEAR(mirrored(tracer.render(near, 0, &video)), of_table, 0.02);
    tracer.render(far, 1, &video);
    EXPECT_NEAR(mirrored(tracer.render(near, 2, &video)), of_video, 0.02);
    for (std::uint64_t i = 3; i < 70; ++i)
        tracer.render(near, i, &video);
    const double later = mirrored(tracer.render(near, 70, &video));
    EXPECT_LT(later, 0.9 * of_video);
    EXPECT_GT(later, 0.5 * of_video);
    EXPECT_GT(mirrored(tracer.render(near, 71, nullptr)), 0.3 * of_video); // the video may be missing
}

TEST(Show, RendersPartsOfThePicture) {
    constexpr std::uint64_t frames = 4;
    const auto shown = [](const std::string &part) { // the colour of a far point of the table
        LinearTracer tracer(with_mirror_and_glass(), {{"quality", "realtime"}, {"show", part}}, "rt_embree");
        EXPECT_EQ(tracer.start(pinhole()), ARHOST_STATUS_OK) << tracer.log();
        for (std::uint64_t i = 1; i < frames; ++i)
            tracer.render(turned(0), i);
        const LinearPicture picture = tracer.render(turned(0), frames);
        constexpr std::uint32_t x = 10, y = height - 10;
        EXPECT_EQ(picture.value(x, y, 4), 0); // the transmittance
        return glm::vec3(picture.value(x, y, 0), picture.value(x, y, 1), picture.value(x, y, 2));
    };
    const auto near = [](glm::vec3 a, glm::vec3 b) { return glm::distance(a, b) < 0.04f; };
    EXPECT_PRED2(near, shown("normals"), glm::vec3(0.5, 0.5, 1));
    EXPECT_PRED2(near, shown("history"), glm::vec3(frames / 32.0f));
    EXPECT_PRED2(near, shown("shadow"), glm::vec3(0.5));
    EXPECT_PRED2(near, shown("bounce"), glm::vec3(0));
    EXPECT_PRED2(near, shown("caustics"), glm::vec3(0));
}

TEST(Show, NeedsDenoising) {
    PluginUnderTest plugin("rt_embree");
    EXPECT_EQ(plugin.create({{"quality", "reference"}, {"show", "normals"}}), ARHOST_STATUS_ERROR_INVALID_ARGUMENT);
    EXPECT_NE(plugin.log().find("option 'show': 'normals' is a view of the denoiser"), std::string::npos)
        << plugin.log();

    SceneBuilder whitted;
    whitted.add_ball("ball", {0, 0, 25, 25}, diffuse(0.7f, 0.2f, 0.1f));
    Tracer tracer(std::move(whitted), {{"quality", "realtime"}, {"show", "normals"}});
    EXPECT_EQ(tracer.start(pinhole()), ARHOST_STATUS_ERROR_UNSUPPORTED);
}

// One of each 2×2 pixels is shaded.
TEST_F(Denoising, ConvergesWithAQuarterOfTheShading) {
    tracer_.shading_px = 2;
    const LinearPicture truth = picture_of(still_life(), converged, turned(0));
    const double noise = difference(picture_of(still_life(), noisy, turned(0)), truth);
    EXPECT_LT(difference(next(0), truth), 0.5 * noise);
    for (int i = 0; i < 14; ++i)
        next(0);
    EXPECT_LT(difference(next(0), truth), 0.2 * noise);
}

TEST_F(Denoising, FollowsTheCameraWithAQuarterOfTheShading) {
    tracer_.shading_px = 2;
    expect_to_follow_the_camera();
}

// Also those of objects that are thinner than two pixels: in the first image, each pixel has the light of its
// surface.
TEST(DenoisingOfAQuarterOfTheShading, LeavesEdgesAsTheyAre) {
    const auto scene = [] {
        SceneBuilder scene(path_traced(1));
        scene.add_mesh("table", square(2000), diffuse(0.4f, 0.4f, 0.4f), ARHOST_ROLE_CATCHER);
        for (int i = 0; i < 6; ++i) {
            const float x = -60 + 20.0f * static_cast<float>(i), half = 0.3f;
            scene.add_mesh("blade " + std::to_string(i),
                           quad({x - half, 0, 0}, {x + half, 0, 0}, {x + half + 9, 0, 60}, {x - half + 9, 0, 60}),
                           i % 2 == 0 ? diffuse(0.8f, 0.2f, 0.2f) : diffuse(0.2f, 0.2f, 0.8f));
        }
        scene.add_mesh("box", moved(cube(10), {70, 30, 10}), diffuse(0.7f, 0.7f, 0.7f));
        return scene;
    };
    LinearTracer fine(scene(), denoised, "rt_embree"), coarse(scene(), denoised, "rt_embree");
    ASSERT_EQ(fine.start(pinhole()), ARHOST_STATUS_OK) << fine.log();
    ASSERT_EQ(coarse.start(pinhole()), ARHOST_STATUS_OK) << coarse.log();
    coarse.shading_px = 2;
    const LinearPicture expected = fine.render(turned(0)), picture = coarse.render(turned(0));
    std::uint32_t objects = 0;
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) {
            const bool shows_object = expected.value(x, y, 4) < 0.9f && expected.value(x, y, 0) > 0.1f;
            if (!shows_object)
                continue;
            ++objects;
            EXPECT_NEAR(picture.value(x, y, 0), expected.value(x, y, 0), 0.3) << x << ", " << y;
        }
    EXPECT_GT(objects, 500u);
}

// Light from the side, or that a mirror throws, changes the table far away from the objects.
struct FarChange {
    const char *name;
    arhost_light lamp;
    bool has_mirror;
};
class DenoisingOfFarChanges : public testing::TestWithParam<FarChange> {
protected:
    static SceneBuilder scene() {
        SceneBuilder scene(path_traced(0.1f));
        scene.add_mesh("table", square(2000), diffuse(0.4f, 0.4f, 0.4f), ARHOST_ROLE_CATCHER);
        if (GetParam().has_mirror)
            scene.add_mesh("mirror", quad({-90, -15, 40}, {-90, 15, 40}, {-90, 15, 52}, {-90, -15, 52}),
                           mirror(0.9f));
        else
            scene.add_ball("ball", {-90, 0, 25, 5}, diffuse(0.7f, 0.2f, 0.1f));
        scene.add_light(GetParam().lamp);
        return scene;
    }
};
arhost_light window() {
    arhost_light lamp = placed(ARHOST_LIGHT_RECTANGLE, {-600, 0, 150}, 1e6f, ARHOST_FALLOFF_INVERSE_SQUARE);
    set3(lamp.direction, 1, 0, 0);
    set3(lamp.axis_u, 0, 100, 0);
    set3(lamp.axis_v, 0, 0, 10);
    return lamp;
}
const arhost_light far_bulb = bulb({-600, 0, 150}, 6, 1e6f, ARHOST_FALLOFF_INVERSE_SQUARE),
                   near_bulb = bulb({-40, 0, 60}, 2, 5e3f, ARHOST_FALLOFF_INVERSE_SQUARE);
INSTANTIATE_TEST_SUITE_P(Lamps, DenoisingOfFarChanges,
                         testing::Values(FarChange{"sun", sun(0.97f, 0, -0.243f), false},
                                         FarChange{"window", window(), false}, FarChange{"bulb", far_bulb, false},
                                         FarChange{"mirror", near_bulb, true}),
                         [](const auto &info) { return std::string(info.param.name); });

TEST_P(DenoisingOfFarChanges, FindsThem) {
    LinearTracer tracer(scene(), denoised, "rt_embree");
    ASSERT_EQ(tracer.start(pinhole()), ARHOST_STATUS_OK) << tracer.log();
    const LinearPicture truth = picture_of(scene(), converged, turned(0));
    LinearPicture picture = tracer.render(turned(0), 0);
    for (std::uint64_t i = 1; i < 16; ++i)
        picture = tracer.render(turned(0), i);
    const auto is_far = [&](std::uint32_t x, std::uint32_t) { return x > width / 2; };
    const LinearPicture untouched = picture_of(scene(), converged, camera({0, -180, 110}, {0, -400, 110}, {0, 0, 1}));
    EXPECT_LT(difference(picture, truth, is_far), 0.3 * difference(untouched, truth, is_far));
    std::uint32_t same = 0;
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x)
            same += picture.value(x, y, 4) == 1 && picture.value(x, y, 5) == 1 && picture.value(x, y, 6) == 1;
    EXPECT_GT(same, width * height / 4);
}

// Light that a mirror throws onto a table with this slope, in degrees.
class DenoisingOfCaustics : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Slopes, DenoisingOfCaustics, testing::Values(0, 30),
                         [](const auto &info) { return std::to_string(static_cast<int>(info.param)); });

TEST_P(DenoisingOfCaustics, LoseNoLight) {
    const auto scene = [] {
        SceneBuilder scene(path_traced(0.1f));
        const double slope = GetParam() * std::numbers::pi / 180;
        const auto corner = [&](double x, double y) {
            return glm::vec3(x * std::cos(slope), y, x * std::sin(slope));
        };
        scene.add_mesh("table", quad(corner(-200, -200), corner(200, -200), corner(200, 200), corner(-200, 200)),
                       diffuse(0.4f, 0.4f, 0.4f), ARHOST_ROLE_CATCHER);
        scene.add_mesh("mirror", quad({-30, -30, 200}, {-30, 30, 200}, {30, 30, 200}, {30, -30, 200}), mirror(0.9f));
        scene.add_light(bulb({-60, 0, 120}, 2, 5e4f, ARHOST_FALLOFF_INVERSE_SQUARE));
        return scene;
    };
    LinearTracer tracer(scene(), denoised, "rt_embree");
    ASSERT_EQ(tracer.start(pinhole()), ARHOST_STATUS_OK) << tracer.log();
    LinearPicture picture = tracer.render(turned(0), 0);
    for (std::uint64_t i = 1; i < 32; ++i)
        picture = tracer.render(turned(0), i);
    const LinearPicture truth = picture_of(scene(), converged, turned(0));
    double light = 0, expected = 0;
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x)
            if (truth.value(x, y, 4) > 1.1f) {
                light += double{picture.value(x, y, 4)} - 1;
                expected += double{truth.value(x, y, 4)} - 1;
            }
    ASSERT_GT(expected, 100);
    EXPECT_NEAR(light / expected, 1, 0.08);
}

// A cube that moves over a table, or a lamp that rises through it.
struct Moving {
    const char *name;
    arhost_material material;
    glm::vec3 before;
};
arhost_material glowing() {
    arhost_material material = metallic_roughness({0, 0, 0}, 0, 1);
    material.emission[0] = material.emission[1] = material.emission[2] = 8;
    return material;
}
class DenoisingOfMotion : public testing::TestWithParam<Moving> {};

INSTANTIATE_TEST_SUITE_P(Objects, DenoisingOfMotion,
                         testing::Values(Moving{"cube", diffuse(0.7f, 0.2f, 0.1f), {-60, 0, 20}},
                                         Moving{"lamp", glowing(), {0, 0, -200}}),
                         [](const auto &of) { return std::string(of.param.name); });

// After five frames, nothing is left of the light before.
TEST_P(DenoisingOfMotion, ForgetsWhatHasMoved) {
    const auto make = [] {
        scene::Settings settings = path_traced(0.4f);
        settings.duration_s = 1;
        SceneBuilder scene(settings);
        scene.add_mesh("table", square(2000), diffuse(0.4f, 0.4f, 0.4f), ARHOST_ROLE_CATCHER);
        const scene::Motion motion{
            .moves = true,
            .node = scene.add_moving_node(GetParam().before, -GetParam().before + 2.0f * glm::vec3(0, 0, 20))};
        scene.add_animated("cube", cube(20), GetParam().material, motion);
        scene.add_light(bulb({0, -100, 250}, 40, 6e4f, ARHOST_FALLOFF_INVERSE_SQUARE));
        return scene;
    };
    const auto picture_after = [&](std::uint64_t frames_before) {
        LinearTracer tracer(make(), denoised, "rt_embree");
        EXPECT_EQ(tracer.start(pinhole()), ARHOST_STATUS_OK) << tracer.log();
        for (std::uint64_t i = 0; i < frames_before; ++i)
            tracer.render(turned(0), i, nullptr, 0.0);
        for (std::uint64_t i = frames_before; i < frames_before + 5; ++i)
            tracer.render(turned(0), i, nullptr, 0.5);
        return tracer.render(turned(0), frames_before + 5, nullptr, 0.5);
    };
    const LinearPicture picture = picture_after(16), fresh = picture_after(0);
    const LinearPicture truth = picture_of(make(), converged, turned(0), 0.5),
                        past = picture_of(make(), converged, turned(0), 0.0);
    constexpr std::size_t transmittance = 4;
    double remaining = 0, change = 0;
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) {
            const auto value = [&](const LinearPicture &of) { return double{of.value(x, y, transmittance)}; };
            if (value(past) < 0.2 || value(truth) < 0.2 || std::abs(value(truth) - value(past)) < 0.05)
                continue; // a cube, or no change
            const double sign = value(truth) > value(past) ? 1 : -1;
            remaining += sign * (value(fresh) - value(picture));
            change += sign * (value(truth) - value(past));
        }
    ASSERT_GT(change, 100);
    EXPECT_LT(std::abs(remaining), 0.05 * change);
}

} // namespace
} // namespace arhost::test
