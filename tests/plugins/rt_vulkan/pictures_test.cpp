// SPDX-License-Identifier: Apache-2.0
//
// The same picture as rt_embree's, scene by scene, from afar and from near.
#include "scene_views.hpp"

namespace arhost::test {

class SamePicture : public testing::TestWithParam<View> {};

TEST_P(SamePicture, AsRtEmbreeGives) {
    ARHOST_REQUIRE_VULKAN();
    const std::filesystem::path file = file_of(GetParam());
    const Options options{{"samples", GetParam().samples}};
    Tracer vulkan(scene::load_scene(file), options, "rt_vulkan"), embree(scene::load_scene(file), options);
    ASSERT_EQ(vulkan.start(small), ARHOST_OK) << vulkan.plugin().log();
    ASSERT_EQ(embree.start(small), ARHOST_OK);
    // Behind glass the last bits decide which facet is next: there the measure is how much Embree differs from
    // itself.
    Tracer robust(scene::load_scene(file), {{"samples", GetParam().samples}, {"robust", "true"}});
    const bool glass = has_glass(vulkan.scene());
    if (glass) {
        ASSERT_EQ(robust.start(small), ARHOST_OK);
    }
    scene::MotionEvaluator motion(vulkan.scene());
    int shown = 0;
    for (const double nearness : nearnesses) {
        const arhost_camera view = camera_for(vulkan.scene(), nearness);
        const arhost_motion then = motion.at(GetParam().time_s);
        Picture got(small), expected(small);
        ASSERT_EQ(vulkan.try_render(view, got, &then), ARHOST_OK) << vulkan.plugin().log();
        ASSERT_EQ(embree.try_render(view, expected, &then), ARHOST_OK);
        const std::string name = GetParam().name + (nearness < 1 ? "-near" : "-far");
        keep(got, name + "-vulkan");
        keep(expected, name + "-embree");
        const Likeness like = likeness(got, expected);
        double least_psnr = 45;
        if (glass) {
            Picture again(small);
            ASSERT_EQ(robust.try_render(view, again, &then), ARHOST_OK);
            least_psnr = std::min(40.0, likeness(again, expected).psnr - 3);
        }
        std::cout << name << ": " << like << "; at least " << least_psnr << " dB wanted" << std::endl;
        EXPECT_LE(like.alphas_off, like.pixels / 1000) << like;
        EXPECT_EQ(like.alphas_off_inside, 0) << like;
        // A few rays that go another way through glass are no other picture, however bright what they meet.
        if (!(glass && 50 * like.colours_off <= like.inside)) {
            EXPECT_GE(like.psnr, least_psnr) << like;
        }
        shown += like.inside;
    }
    EXPECT_GT(shown, 200) << "hardly anything to compare";
}

INSTANTIATE_TEST_SUITE_P(Scenes, SamePicture, every_scene, [](const auto &info) { return name_of_view(info.param); });

} // namespace arhost::test
