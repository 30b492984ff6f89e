// SPDX-License-Identifier: Apache-2.0
//
// Compares denoised images of rt_vulkan with those of rt_embree. Both have the same denoiser; what they give it
// differs in rounding, in the number of pixels in which catchers are sampled, and in photons.
#include "still_life.hpp"
#include "two_tracers.hpp"

#include <array>
#include <memory>

namespace arhost::test {
namespace {

const arhost_intrinsics small = pinhole(90, 70, 90);
const Options denoised{{"quality", "realtime"}}, converged{{"samples", "256"}};

SceneBuilder on_matt_table() {
    SceneBuilder scene = with_mirror_and_glass();
    arhost_material frosted = glass_of();
    frosted.roughness = 0.3f;
    scene.add_ball("frosted", {50, -10, 12, 12}, frosted);
    return scene;
}
SceneBuilder on_glossy_table() {
    return with_mirror_and_glass(metallic_roughness({0.2f, 0.2f, 0.2f}, 0, 0.15f));
}

} // namespace

class VulkanDenoising : public testing::Test {
protected:
    void SetUp() override { ARHOST_REQUIRE_VULKAN(); }
};

namespace {

// Expects that the images of both ray tracers after some frames have about the same distance from the converged
// picture, and from each other. `tolerance`: RMS, in linear light. It is for edges in mirrors and glass, which get
// more samples in rt_embree, and for matt tables, whose light rt_embree keeps in cells of 2×2 px.
void expect_rt_embrees_picture(SceneBuilder (*scene)(), double degrees_per_frame, int frames, double tolerance) {
    const Video video(small);
    const auto last_picture = [&](const std::string &plugin) {
        LinearTracer tracer(scene(), denoised, plugin);
        EXPECT_EQ(tracer.start(small, &video), ARHOST_STATUS_OK) << tracer.log();
        for (int i = 0; i + 1 < frames; ++i)
            tracer.render(turned(degrees_per_frame * i, small), static_cast<std::uint64_t>(i), &video);
        return tracer.render(turned(degrees_per_frame * (frames - 1), small), static_cast<std::uint64_t>(frames - 1),
                             &video);
    };
    LinearTracer reference(scene(), converged, "rt_embree");
    ASSERT_EQ(reference.start(small, &video), ARHOST_STATUS_OK) << reference.log();
    const LinearPicture truth = reference.render(turned(degrees_per_frame * (frames - 1), small), 0, &video);
    const LinearPicture by_vulkan = last_picture("rt_vulkan"), by_embree = last_picture("rt_embree");
    EXPECT_LT(difference(by_vulkan, by_embree), tolerance);
    EXPECT_LT(difference(by_vulkan, truth), 1.2 * difference(by_embree, truth) + 0.002);
}

TEST_F(VulkanDenoising, ConvergesToRtEmbreesPicture) {
    expect_rt_embrees_picture(&on_matt_table, 0, 16, 0.04);
}

TEST_F(VulkanDenoising, ConvergesOnGlossyTables) {
    expect_rt_embrees_picture(&on_glossy_table, 0, 16, 0.03);
}

TEST_F(VulkanDenoising, FollowsTheCamera) {
    expect_rt_embrees_picture(&on_matt_table, 0.7, 12, 0.04);
}

TEST_F(VulkanDenoising, ImagesDependOnTheRequestOnly) {
    LinearTracer one(on_glossy_table(), {{"quality", "realtime"}, {"threads", "1"}}, "rt_vulkan"),
        three(on_glossy_table(), {{"quality", "realtime"}, {"threads", "3"}}, "rt_vulkan");
    const Video video(small);
    for (LinearTracer *tracer : {&one, &three})
        ASSERT_EQ(tracer->start(small, &video), ARHOST_STATUS_OK) << tracer->log();
    for (std::uint64_t frame = 0; frame < 4; ++frame) {
        const arhost_camera view = turned(0.5 * static_cast<double>(frame / 2), small);
        EXPECT_EQ(three.render(view, frame, &video).pixels(), one.render(view, frame, &video).pixels()) << frame;
        EXPECT_TRUE(std::ranges::equal(three.state(), one.state())) << frame;
    }
    // The state is all that an image needs of earlier ones.
    const arhost_camera view = turned(1, small);
    LinearTracer fresh(on_glossy_table(), denoised, "rt_vulkan");
    ASSERT_EQ(fresh.start(small, &video), ARHOST_STATUS_OK) << fresh.log();
    fresh.render(view, 0, &video);
    std::ranges::copy(one.state(), fresh.state().begin());
    EXPECT_EQ(fresh.render(view, 4, &video).pixels(), one.render(view, 4, &video).pixels());
}

TEST_F(VulkanDenoising, IgnoresAStateOfAnotherVersionOrSize) {
    LinearTracer tracer(on_matt_table(), denoised, "rt_vulkan");
    ASSERT_EQ(tracer.start(small), ARHOST_STATUS_OK) << tracer.log();
    const LinearPicture first = tracer.render(turned(0, small), 0);
    for (const std::size_t field : {0u, 4u, 8u}) { // version, width, height
        ++reinterpret_cast<unsigned char *>(tracer.state().data())[field];
        EXPECT_EQ(tracer.render(turned(0, small), 0).pixels(), first.pixels()) << field;
    }
}

// Hosts may provide no memory for a state; such images are those of `quality: reference`.
TEST_F(VulkanDenoising, NeedsAState) {
    const auto picture_with = [](const Options &options) {
        return picture_by("rt_vulkan", on_matt_table(), turned(0, small), options).pixels();
    };
    EXPECT_EQ(picture_with(denoised), picture_with({{"quality", "reference"}, {"samples", "1"}}));
}

TEST_F(VulkanDenoising, RejectsAStateThatIsTooSmall) {
    Tracer tracer(on_matt_table(), denoised, "rt_vulkan");
    ASSERT_EQ(tracer.start(small), ARHOST_STATUS_OK) << tracer.log();
    std::array<std::byte, 64> state;
    arhost_render_request request{};
    request.struct_size = sizeof request;
    request.camera = turned(0, small);
    request.state_after = state.data();
    request.state_size = state.size();
    Picture picture(small);
    const arhost_image image = picture.image();
    EXPECT_EQ(tracer.plugin().functions<arhost_raytracer>().render(tracer.plugin().instance(), &request, &image,
                                                                   &picture.info),
              ARHOST_STATUS_ERROR_INVALID_ARGUMENT);
    EXPECT_THAT(tracer.log(), testing::HasSubstr("the state has 64 bytes; the host must provide"));
}

TEST_F(VulkanDenoising, ShowsPartsOfThePicture) {
    constexpr std::uint64_t frames = 4;
    const auto shown = [](const std::string &part) { // the colour of a far point of the table
        LinearTracer tracer(on_matt_table(), {{"quality", "realtime"}, {"show", part}}, "rt_vulkan");
        EXPECT_EQ(tracer.start(small), ARHOST_STATUS_OK) << tracer.log();
        for (std::uint64_t i = 1; i < frames; ++i)
            tracer.render(turned(0, small), i);
        const LinearPicture picture = tracer.render(turned(0, small), frames);
        const std::uint32_t x = 5, y = small.height - 5;
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

TEST_F(VulkanDenoising, ViewsNeedDenoising) {
    PluginUnderTest plugin("rt_vulkan");
    EXPECT_EQ(plugin.create({{"quality", "reference"}, {"show", "normals"}}), ARHOST_STATUS_ERROR_INVALID_ARGUMENT);
    EXPECT_THAT(plugin.log(), testing::HasSubstr("option 'show': 'normals' is a view of the denoiser"));
}

} // namespace
} // namespace arhost::test
