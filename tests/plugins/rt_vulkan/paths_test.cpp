// SPDX-License-Identifier: Apache-2.0
//
// Checks that the hardware ray tracing paths "query" and "pipeline" give the same images as the path "plain". Each
// scene is viewed from far and from near.
#include "scene_views.hpp"

namespace arhost::test {

class PathImages : public testing::TestWithParam<std::tuple<std::string, View>> {};

TEST_P(PathImages, MatchThePlainPath) {
    const auto &[path, view] = GetParam();
    ARHOST_REQUIRE_VULKAN(path);
    const std::filesystem::path file = file_of(view);
    Tracer traced(scene::load_scene(file), {{"samples", view.samples}, {"path", path}}, "rt_vulkan"),
        plain(scene::load_scene(file), {{"samples", view.samples}, {"path", "plain"}}, "rt_vulkan");
    ASSERT_EQ(traced.start(small), ARHOST_STATUS_OK) << traced.log();
    ASSERT_EQ(plain.start(small), ARHOST_STATUS_OK) << plain.log();
    int shown = 0;
    for (const double nearness : nearnesses) {
        const arhost_camera camera = camera_for(traced.scene(), nearness, small);
        const Picture got = traced.render_at(view.time_s, camera), expected = plain.render_at(view.time_s, camera);
        const std::string name = view.name + (nearness < 1 ? "-near-" : "-far-") + path;
        keep(got, name);
        const Likeness like = likeness(got, expected);
        std::cout << name << ": " << like << std::endl;
        // Where two triangles are adjacent or coplanar, devices differ in which of them a ray hits.
        EXPECT_LE(like.alphas_off, like.pixels / 1000) << like;
        EXPECT_EQ(like.alphas_off_inside, 0) << like;
        if (traced.log().find("llvmpipe") != std::string::npos) {
            EXPECT_EQ(like.squares, 0) << like; // llvmpipe does not reorder floating-point operations
        } else if (!(has_glass(traced.scene()) && 50 * like.colours_off <= like.inside)) {
            EXPECT_GE(like.psnr(), 45) << like;
        }
        shown += like.inside;
    }
    EXPECT_GT(shown, 200) << "too few pixels to compare";
}

constexpr auto name_of = [](const auto &info) {
    return std::get<0>(info.param) + "_" + name_of_view(std::get<1>(info.param));
};
// These two scenes contain all roles and material models, motion and deformation. rt_vulkan_test.cpp tests alpha
// cutoffs and lights on each path.
INSTANTIATE_TEST_SUITE_P(Sample, PathImages,
                         testing::Combine(testing::Values("query", "pipeline"), scenes_named({"classes", "moving"})),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Exhaustive, PathImages, testing::Combine(testing::Values("query", "pipeline"), every_scene),
                         name_of);

} // namespace arhost::test
