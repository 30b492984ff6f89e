// SPDX-License-Identifier: Apache-2.0
//
// Checks that rt_vulkan gives the same images as rt_embree. Each scene is viewed from far and from near.
#include "scene_views.hpp"

namespace arhost::test {

class SceneImages : public testing::TestWithParam<View> {};

TEST_P(SceneImages, MatchRtEmbree) {
    ARHOST_REQUIRE_VULKAN();
    const std::filesystem::path file = file_of(GetParam());
    const std::string samples = GetParam().samples;
    Tracer vulkan(scene::load_scene(file), {{"samples", samples}}, "rt_vulkan"),
        embree(scene::load_scene(file), {{"samples", samples}}),
        robust(scene::load_scene(file), {{"samples", samples}, {"robust", "true"}});
    const bool glass = has_glass(vulkan.scene());
    ASSERT_EQ(vulkan.start(small), ARHOST_STATUS_OK) << vulkan.log();
    ASSERT_EQ(embree.start(small), ARHOST_STATUS_OK);
    ASSERT_TRUE(!glass || robust.start(small) == ARHOST_STATUS_OK);
    int shown = 0;
    for (const double nearness : nearnesses) {
        const arhost_camera view = camera_for(vulkan.scene(), nearness, small);
        const double time_s = GetParam().time_s;
        const Picture got = vulkan.render_at(time_s, view), expected = embree.render_at(time_s, view);
        const std::string name = GetParam().name + (nearness < 1 ? "-near" : "-far");
        keep(got, name + "-vulkan");
        keep(expected, name + "-embree");
        const Likeness like = likeness(got, expected);
        std::cout << name << ": " << like << std::endl;
        EXPECT_LE(like.alphas_off, like.pixels / 1000) << like;
        EXPECT_EQ(like.alphas_off_inside, 0) << like;
        EXPECT_GE(like.psnr(), glass ? 40 : 45) << like;
        if (glass) { // see the comment at BehindGlass
            const int robust_off = likeness(robust.render_at(time_s, view), expected).colours_off;
            EXPECT_LE(like.colours_off, robust_off + 3 * std::sqrt(robust_off) + 1)
                << like; // 3 standard deviations of a count
        }
        shown += like.inside;
    }
    EXPECT_GT(shown, 200) << "too few pixels to compare";
}

constexpr auto name_of = [](const auto &info) { return name_of_view(info.param); };
INSTANTIATE_TEST_SUITE_P(Sample, SceneImages, scenes_named({"classes", "moving", "optix-cgl", "vkray-hbf"}), name_of);
INSTANTIATE_TEST_SUITE_P(Exhaustive, SceneImages, every_scene, name_of);

// Behind glass, a rounding error of one hit can decide which triangle the ray hits next. Therefore the difference
// between rt_vulkan and rt_embree may be as large as that between rt_embree's robust and fast traversal. A few bright
// pixels dominate these differences, so they are summed over the images of a camera path.
class BehindGlass : public testing::TestWithParam<View> {};

TEST_P(BehindGlass, DifferenceIsBelowThatOfEmbreesRobustAndFastTraversal) {
    ARHOST_REQUIRE_VULKAN();
    const std::filesystem::path file = file_of(GetParam());
    Tracer vulkan(scene::load_scene(file), {}, "rt_vulkan"), embree(scene::load_scene(file), {}),
        robust(scene::load_scene(file), {{"robust", "true"}});
    const arhost_intrinsics size = pinhole(256, 192, 256);
    for (Tracer *tracer : {&vulkan, &embree, &robust})
        ASSERT_EQ(tracer->start(size), ARHOST_STATUS_OK) << tracer->log();
    Likeness of_vulkan, of_robust;
    for (double nearness = 1.3; nearness > 0.4; nearness -= 0.06) {
        const arhost_camera view = camera_for(vulkan.scene(), nearness, size);
        const Picture by_embree = embree.render_next(view);
        of_vulkan += likeness(vulkan.render_next(view), by_embree);
        of_robust += likeness(robust.render_next(view), by_embree);
    }
    std::cout << GetParam().name << "-glass: " << of_vulkan << '\n'
              << GetParam().name << "-own: " << of_robust << std::endl;
    EXPECT_LE(of_vulkan.colours_off, of_robust.colours_off);
    EXPECT_GE(of_vulkan.psnr(), of_robust.psnr());
    EXPECT_EQ(of_vulkan.alphas_off_inside, 0);
}

INSTANTIATE_TEST_SUITE_P(Exhaustive, BehindGlass,
                         scenes_named({"optix-gd", "optix-gl", "optix-skybox-lucy", "optix-skybox-teapot"}), name_of);

} // namespace arhost::test
