// SPDX-License-Identifier: Apache-2.0
//
// Loads every scene in config/scenes twice: with stand-ins, as after a fresh checkout, and with the meshes that
// tools/get-models downloads, if present.
#include "plugin_under_test.hpp"
#include "scene/mesh_loader.hpp"
#include "scene/motion.hpp"
#include "scene/scene_loader.hpp"

#include <directories.hpp>
#include <glm/common.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>

using namespace arhost::scene;
namespace fs = std::filesystem;

namespace {

const fs::path folder = fs::path(arhost::test::source_directory()) / "config/scenes";

// Scenes of the dissertation (tables 3 and 4, figures 14 to 20) and additional ones. The number is the triangle count
// of the mesh according to table 1 of the dissertation, or 0 if the table does not have it.
const std::map<std::string, std::size_t> faces = {
    {"demo", 0},
    {"moving", 0},
    {"optix-cs", 0},
    {"optix-b", 4968},
    {"optix-hb", 1'087'451},
    {"optix-gl", 448'880},
    {"optix-cgl", 448'880},
    {"optix-gd", 871'306},
    {"optix-cgd", 871'306},
    {"optix-skybox-bunny", 4968},
    {"optix-skybox-dragon", 871'306},
    {"optix-skybox-buddha", 1'087'451},
    {"optix-skybox-teapot", 126'048},
    {"optix-skybox-lucy", 448'880},
    {"vkray-cs", 0},
    {"vkray-b", 4968},
    {"vkray-hb", 1'087'451},
    {"vkray-hbf", 1'087'451},
    {"vkray-md", 871'306},
    {"vkray-cmd", 871'306},
};

std::vector<std::string> scene_names() {
    std::vector<std::string> names;
    for (const auto &entry : fs::directory_iterator(folder))
        if (entry.path().extension() == ".yaml")
            names.push_back(entry.path().stem().string());
    std::ranges::sort(names);
    return names;
}

// Loads and validates a scene. Returns the triangle count of the largest mesh.
std::size_t load_and_check(const fs::path &file, std::size_t *warnings) {
    LoadCallbacks callbacks;
    callbacks.warning = [&](const std::string &) { ++*warnings; };
    const Arena arena = load_scene(file, callbacks).build();
    EXPECT_EQ(validate(arena.bytes()), "");
    const arhost_scene &scene = arena.scene();
    EXPECT_EQ(scene.axes, file.stem().string().starts_with("vkray") ? ARHOST_AXES_Y_UP : ARHOST_AXES_Z_UP);
    EXPECT_NEAR(scene.bounds_min[scene.axes == ARHOST_AXES_Z_UP ? 2 : 1], 0, 1e-6)
        << "the scene does not stand on the marker";
    EXPECT_EQ(scene.lights.count, 1u);
    std::size_t largest = 0;
    const auto *geometries =
        reinterpret_cast<const arhost_geometry *>(arena.bytes().data() + scene.geometries.offset);
    for (std::size_t i = 0; i < scene.geometries.count; ++i)
        largest = std::max<std::size_t>(largest, geometries[i].indices.count);
    return largest;
}

} // namespace

TEST(ShippedScenes, AreTheDocumentedOnes) {
    std::vector<std::string> names;
    for (const auto &[name, count] : faces)
        names.push_back(name);
    EXPECT_EQ(scene_names(), names);
}

class ShippedScene : public testing::TestWithParam<std::string> {};

TEST_P(ShippedScene, LoadsWithAStandInOfTheDocumentedTriangleCount) {
    const arhost::test::ScratchFolder scratch; // this folder has no models/
    fs::create_directories(scratch.path() / "config/scenes");
    const fs::path file = scratch.path() / "config/scenes" / (GetParam() + ".yaml");
    fs::copy_file(folder / file.filename(), file);
    for (const char *shipped : {"meshes", "textures"})
        fs::create_directory_symlink(folder / shipped, file.parent_path() / shipped);
    std::size_t warnings = 0;
    const std::size_t largest = load_and_check(file, &warnings);
    const std::size_t expected = faces.contains(GetParam()) ? faces.at(GetParam()) : 0;
    EXPECT_EQ(warnings, expected > 0);
    if (expected > 0) {
        EXPECT_EQ(largest, expected);
    }
}

TEST_P(ShippedScene, LoadsFromItsFolder) {
    std::size_t warnings = 0;
    load_and_check(folder / (GetParam() + ".yaml"), &warnings);
}

INSTANTIATE_TEST_SUITE_P(Config, ShippedScene, testing::ValuesIn(scene_names()), [](const auto &scene) {
    std::string name = scene.param;
    std::ranges::replace(name, '-', '_');
    return name;
});

TEST(MovingScene, LoopsWithoutAJump) {
    const Arena arena = load_scene(folder / "moving.yaml").build();
    MotionEvaluator evaluator(arena.scene());
    const auto coordinates_at = [&](double time_s) { // the coordinates of all objects and vertices
        const arhost_motion motion = evaluator.at(time_s);
        std::vector<float> coordinates;
        for (std::uint32_t i = 0; i < motion.moved_count; ++i)
            coordinates.insert(coordinates.end(), motion.moved[i].world_from_object,
                               motion.moved[i].world_from_object + 12);
        for (std::uint32_t i = 0; i < motion.deformed_count; ++i)
            coordinates.insert(coordinates.end(), motion.deformed[i].positions,
                               motion.deformed[i].positions + 3 * std::size_t(motion.deformed[i].vertex_count));
        return coordinates;
    };
    const auto max_displacement = [&](double from_s, double to_s) {
        const std::vector<float> from = coordinates_at(from_s), to = coordinates_at(to_s);
        float largest = 0;
        for (std::size_t i = 0; i < from.size(); ++i)
            largest = std::max(largest, std::abs(from[i] - to[i]));
        return largest;
    };
    const double loop_s = arena.scene().duration_s, step_s = 1e-3;
    EXPECT_EQ(evaluator.at(0).moved_count, 3u);
    EXPECT_EQ(evaluator.at(0).deformed_count, 1u);
    EXPECT_GT(max_displacement(0, loop_s / 2), 50);
    EXPECT_LT(max_displacement(loop_s - step_s, 0), 0.2);
    for (double t = 0; t < loop_s; t += loop_s / 24) // no jump within the period either
        EXPECT_LT(max_displacement(t, t + step_s), 0.2) << t;
}

// Downloads from a local folder, so the test needs no network.
TEST(GetModels, WritesNormalizedMeshes) {
    ARHOST_REQUIRE_SHARED_DATA("meshes");
    const arhost::test::ScratchFolder scratch;
    const std::string command = arhost::test::source_directory() + "/tools/get-models " +
                                arhost::test::shared_data_directory() + "/meshes " + scratch.path().string() +
                                " > /dev/null";
    ASSERT_EQ(std::system(command.c_str()), 0);
    for (const auto &[name, triangles] : {std::pair("bunny", 4968),
                                          {"bunny_69k", 69'451},
                                          {"teapot", 6320},
                                          {"lucy", 99'970},
                                          {"dragon", 871'414},
                                          {"buddha", 100'000}}) {
        const TriangleMesh mesh = load_mesh(scratch.path() / (name + std::string(".ply")));
        EXPECT_EQ(mesh.triangles.size(), static_cast<std::size_t>(triangles)) << name;
        glm::vec3 low = mesh.positions[0], high = low;
        for (const glm::uvec3 &t : mesh.triangles)
            for (const auto corner : {t.x, t.y, t.z}) {
                low = glm::min(low, mesh.positions[corner]);
                high = glm::max(high, mesh.positions[corner]);
            }
        EXPECT_NEAR(low.y, 0, 1e-6) << name;
        EXPECT_NEAR(high.y, 1, 1e-6) << name;
        EXPECT_NEAR(low.x, -high.x, 1e-6) << name;
        EXPECT_NEAR(low.z, -high.z, 1e-6) << name;
    }
}
