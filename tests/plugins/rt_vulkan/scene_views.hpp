// SPDX-License-Identifier: Apache-2.0
//
// Lists the scenes and camera positions of the image comparisons.
#pragma once

#include "scene/motion.hpp"
#include "scene/scene_loader.hpp"
#include "two_tracers.hpp"

#include <directories.hpp>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <set>
#include <string>
#include <vector>

namespace arhost::test {

struct View {
    std::string name, scene; // `scene` is a path relative to the project's root
    std::string samples = "1";
    double time_s = 0;
};
inline std::ostream &operator<<(std::ostream &stream, const View &view) {
    return stream << view.name;
}

inline const arhost_intrinsics small = pinhole(128, 96, 128);

// Returns a camera that looks at the position of the dissertation's marker. Its distance is proportional to
// `nearness`; 1 is far.
inline arhost_camera camera_for(const arhost_scene &scene, double nearness, const arhost_intrinsics &size) {
    const double back = -330 * nearness, up = 150 * nearness;
    return scene.axes == ARHOST_AXES_Z_UP ? camera({25 * nearness, back, up}, {0, 0, 50}, {0, 0, 1}, size)
                                          : camera({25 * nearness, up, -back}, {0, 50, 0}, {0, 1, 0}, size);
}

inline const double nearnesses[] = {1.0, 0.45};

inline std::filesystem::path file_of(const View &view) {
    return std::filesystem::path(arhost::test::source_directory()) / view.scene;
}

// If the environment variable ARHOST_KEEP_PICTURES names a folder, writes the picture there for inspection.
inline void keep(const Picture &picture, const std::string &name) {
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

inline bool has_glass(const arhost_scene &scene) {
    const auto *materials =
        reinterpret_cast<const arhost_material *>(reinterpret_cast<const char *>(&scene) + scene.materials.offset);
    return std::any_of(materials, materials + scene.materials.count,
                       [](const arhost_material &material) { return material.model == ARHOST_MATERIAL_GLASS; });
}

inline const std::vector<View> every_view = {View{"classes", "tests/plugins/rt_embree/golden/classes.yaml"},
                                             View{"room", "tests/plugins/rt_embree/golden/room.yaml", "4"},
                                             View{"desk", "tests/plugins/rt_embree/golden/desk.yaml"},
                                             View{"moving", "config/scenes/moving.yaml", "4", 1.3},
                                             View{"optix-b", "config/scenes/optix-b.yaml"},
                                             View{"optix-cgd", "config/scenes/optix-cgd.yaml"},
                                             View{"optix-cgl", "config/scenes/optix-cgl.yaml"},
                                             View{"optix-cs", "config/scenes/optix-cs.yaml"},
                                             View{"optix-gd", "config/scenes/optix-gd.yaml"},
                                             View{"optix-gl", "config/scenes/optix-gl.yaml"},
                                             View{"optix-hb", "config/scenes/optix-hb.yaml"},
                                             View{"optix-skybox-buddha", "config/scenes/optix-skybox-buddha.yaml"},
                                             View{"optix-skybox-bunny", "config/scenes/optix-skybox-bunny.yaml"},
                                             View{"optix-skybox-dragon", "config/scenes/optix-skybox-dragon.yaml"},
                                             View{"optix-skybox-lucy", "config/scenes/optix-skybox-lucy.yaml"},
                                             View{"optix-skybox-teapot", "config/scenes/optix-skybox-teapot.yaml"},
                                             View{"vkray-b", "config/scenes/vkray-b.yaml"},
                                             View{"vkray-cmd", "config/scenes/vkray-cmd.yaml"},
                                             View{"vkray-cs", "config/scenes/vkray-cs.yaml"},
                                             View{"vkray-hb", "config/scenes/vkray-hb.yaml"},
                                             View{"vkray-hbf", "config/scenes/vkray-hbf.yaml"},
                                             View{"vkray-md", "config/scenes/vkray-md.yaml"}};
inline const auto every_scene = testing::ValuesIn(every_view);

inline auto scenes_named(const std::set<std::string> &names) {
    std::vector<View> views;
    std::copy_if(every_view.begin(), every_view.end(), std::back_inserter(views),
                 [&](const View &view) { return names.contains(view.name); });
    return testing::ValuesIn(views);
}

inline std::string name_of_view(const View &view) {
    std::string name = view.name;
    std::replace(name.begin(), name.end(), '-', '_');
    return name;
}

} // namespace arhost::test
