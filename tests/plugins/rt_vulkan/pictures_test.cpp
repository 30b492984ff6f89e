// SPDX-License-Identifier: Apache-2.0
//
// The same picture as rt_embree's, scene by scene, from afar and from near.
#include "scene/loader.hpp"
#include "scene/motion.hpp"
#include "two_tracers.hpp"

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include <cstdlib>

namespace arhost::test {
namespace {

struct View {
    std::string name, scene; // below the project's folder
    std::string samples = "1";
    double time_s = 0;
};
std::ostream &operator<<(std::ostream &stream, const View &view) {
    return stream << view.name;
}

const arhost_intrinsics small = pinhole(128, 96, 128);

// Where the dissertation's marker lies, as its camera sees it; `nearness` 1 is from afar.
arhost_camera camera_for(const arhost_scene &scene, double nearness) {
    const double away = -330 * nearness, up = 150 * nearness;
    return scene.axes == ARHOST_Z_UP ? camera({25 * nearness, away, up}, {0, 0, 50}, {0, 0, 1}, small)
                                     : camera({25 * nearness, up, -away}, {0, 50, 0}, {0, 1, 0}, small);
}

class SamePicture : public testing::TestWithParam<View> {};

// For eyes: ARHOST_KEEP_PICTURES=FOLDER.
void keep(const Picture &picture, const std::string &name) {
    const char *folder = std::getenv("ARHOST_KEEP_PICTURES");
    if (!folder)
        return;
    cv::Mat image(static_cast<int>(picture.height), static_cast<int>(picture.width), CV_8UC4);
    for (std::uint32_t y = 0; y < picture.height; ++y)
        for (std::uint32_t x = 0; x < picture.width; ++x) {
            const Pixel p = picture.at(x, y);
            image.at<cv::Vec4b>(static_cast<int>(y), static_cast<int>(x)) =
                cv::Vec4b(static_cast<std::uint8_t>(p[2]), static_cast<std::uint8_t>(p[1]),
                          static_cast<std::uint8_t>(p[0]), static_cast<std::uint8_t>(p[3]));
        }
    cv::imwrite(std::string(folder) + "/" + name + ".png", image);
}

bool has_glass(const arhost_scene &scene) {
    const auto *materials =
        reinterpret_cast<const arhost_material *>(reinterpret_cast<const char *>(&scene) + scene.materials.offset);
    return std::any_of(materials, materials + scene.materials.count,
                       [](const arhost_material &material) { return material.model == ARHOST_GLASS; });
}

} // namespace

TEST_P(SamePicture, AsRtEmbreeGives) {
    ARHOST_REQUIRE_VULKAN();
    const std::filesystem::path file = std::filesystem::path(ARHOST_SOURCE_DIRECTORY) / GetParam().scene;
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
    for (const double nearness : {1.0, 0.45}) {
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

INSTANTIATE_TEST_SUITE_P(
    Scenes, SamePicture,
    testing::Values(View{"classes", "tests/plugins/rt_embree/golden/classes.yaml"},
                    View{"room", "tests/plugins/rt_embree/golden/room.yaml", "4"},
                    View{"demo", "config/scenes/demo.yaml"}, View{"moving", "config/scenes/moving.yaml", "4", 1.3},
                    View{"optix-b", "config/scenes/optix-b.yaml"}, View{"optix-cgd", "config/scenes/optix-cgd.yaml"},
                    View{"optix-cgl", "config/scenes/optix-cgl.yaml"},
                    View{"optix-cs", "config/scenes/optix-cs.yaml"}, View{"optix-gd", "config/scenes/optix-gd.yaml"},
                    View{"optix-gl", "config/scenes/optix-gl.yaml"}, View{"optix-hb", "config/scenes/optix-hb.yaml"},
                    View{"optix-skybox-buddha", "config/scenes/optix-skybox-buddha.yaml"},
                    View{"optix-skybox-bunny", "config/scenes/optix-skybox-bunny.yaml"},
                    View{"optix-skybox-dragon", "config/scenes/optix-skybox-dragon.yaml"},
                    View{"optix-skybox-lucy", "config/scenes/optix-skybox-lucy.yaml"},
                    View{"optix-skybox-teapot", "config/scenes/optix-skybox-teapot.yaml"},
                    View{"vkray-b", "config/scenes/vkray-b.yaml"}, View{"vkray-cmd", "config/scenes/vkray-cmd.yaml"},
                    View{"vkray-cs", "config/scenes/vkray-cs.yaml"}, View{"vkray-hb", "config/scenes/vkray-hb.yaml"},
                    View{"vkray-hbf", "config/scenes/vkray-hbf.yaml"},
                    View{"vkray-md", "config/scenes/vkray-md.yaml"}),
    [](const auto &info) {
        std::string name = info.param.name;
        std::replace(name.begin(), name.end(), '-', '_');
        return name;
    });

} // namespace arhost::test
