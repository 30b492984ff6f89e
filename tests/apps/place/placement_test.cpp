// SPDX-License-Identifier: Apache-2.0
#include "base/program.hpp"
#include "base/temporary_folder.hpp"
#include "place/placement.hpp"
#include "scene/scene_loader.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

namespace arhost::place {
namespace {

using testing::HasSubstr;
using testing::Not;

const std::string tetrahedron = "v 0 0 0\nv 4 0 0\nv 0 2 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

class APlacement : public testing::Test {
protected:
    void write(const std::string &name, const std::string &text) { std::ofstream(folder_.path() / name) << text; }
    Placement of(const std::string &model) const {
        Placement placement;
        placement.model = folder_.path() / model;
        placement.target = "tag36h11:23";
        return placement;
    }
    std::string configuration(const Placement &placement) const {
        return configuration_text(placement, folder_.path() / "a.scene.yaml", folder_.path() / "a.yaml");
    }
    std::string error(const Placement &placement) const {
        try {
            scene_text(placement, folder_.path() / "a.scene.yaml");
            return configuration(placement);
        } catch (const base::InvalidInput &invalid) {
            return invalid.what();
        }
    }
    const base::TemporaryFolder folder_{"arhost-test"};
};

TEST_F(APlacement, StandsOnItsMarkerInTheSizeOfIt) {
    write("a \"tetra\".obj", tetrahedron);
    Placement placement = of("a \"tetra\".obj");
    placement.fit_mm = 60;
    write("a.scene.yaml", scene_text(placement, folder_.path() / "a.scene.yaml"));
    scene::Arena arena = scene::load_scene(folder_.path() / "a.scene.yaml").build();
    ASSERT_EQ(scene::validate(arena.bytes()), "");
    const arhost_scene &scene = arena.scene();
    ASSERT_EQ(scene.objects.count, 2u);
    EXPECT_EQ(scene.integrator, ARHOST_INTEGRATOR_PATH);
    const auto *geometry = reinterpret_cast<const arhost_geometry *>(arena.bytes().data() + scene.geometries.offset);
    const auto *p = reinterpret_cast<const float *>(arena.bytes().data() + geometry->positions.offset);
    EXPECT_THAT(std::vector<float>(p, p + 6), testing::ElementsAre(-30, -15, 0, 30, -15, 0)) << "the largest side";
    EXPECT_EQ(p[11], 15) << "the top";
}

TEST_F(APlacement, UsesTheMaterialsOfTheFile) {
    write("a.obj", "mtllib a b.mtl \nusemtl red\n" + tetrahedron);
    write("a b.mtl", "");
    write("d.obj", "mtllib missing.mtl\n" + tetrahedron);
    write("b.obj", tetrahedron);
    write("c.GLB", "");
    const auto text = [&](const char *file) { return scene_text(of(file), folder_.path() / "a.scene.yaml"); };
    EXPECT_THAT(text("a.obj"), Not(HasSubstr("material: plain")));
    EXPECT_THAT(text("b.obj"), HasSubstr("material: plain"));
    EXPECT_THAT(text("d.obj"), HasSubstr("material: plain"));
    EXPECT_THAT(text("c.GLB"), testing::AllOf(HasSubstr("gltf: \"c.GLB\""), Not(HasSubstr("material: plain"))));
}

TEST_F(APlacement, NamesFilesRelativeToTheOneThatItWrites) {
    Placement placement = of("a.obj");
    placement.source = folder_.path() / "videos/a.mp4";
    placement.camera = folder_.path() / "camera.yaml";
    placement.output = "out.mp4";
    const std::string text = configuration(placement);
    EXPECT_THAT(text, HasSubstr("mode: lockstep"));
    EXPECT_THAT(text, HasSubstr("source: {plugin: source_file, path: \"videos/a.mp4\"}"));
    EXPECT_THAT(text, HasSubstr("camera: {file: \"camera.yaml\"}"));
    placement.width = 640;
    placement.height = 480;
    EXPECT_THAT(configuration(placement), HasSubstr("camera: {file: \"camera.yaml\", width: 640, height: 480}"));
    placement.camera = "/elsewhere/camera.yaml";
    EXPECT_THAT(configuration(placement), HasSubstr("camera: {file: \"/elsewhere/camera.yaml\""));
    EXPECT_THAT(
        text,
        HasSubstr("tracker: {plugin: tracker_aruco, targets: [{marker: 23, family: \"tag36h11\", side_mm: 80}]}"));
    EXPECT_THAT(text, HasSubstr("scene: \"a.scene.yaml\""));
    EXPECT_THAT(text, HasSubstr("outputs: [{plugin: sink_video, path: \"out.mp4\"}]"));
}

TEST_F(APlacement, ChoosesPlugins) {
    Placement placement = of("a.obj");
    EXPECT_THAT(configuration(placement), HasSubstr("source: {plugin: source_v4l2, allow: [video]"));
    EXPECT_THAT(configuration(placement), HasSubstr("mode: live"));
    EXPECT_THAT(configuration(placement), HasSubstr("sink_window"));
    placement.source = "rtsp://camera/1";
    EXPECT_THAT(configuration(placement), HasSubstr("source: {plugin: source_network, allow: [network]"));
    placement.target = "artoolkit-3x3:7";
    EXPECT_THAT(configuration(placement), HasSubstr("tracker_pattern, targets: [{marker: 7"));
    placement.target = folder_.path() / "hiro.patt";
    EXPECT_THAT(configuration(placement), HasSubstr("tracker_pattern, targets: [{pattern: \"hiro.patt\""));
}

TEST_F(APlacement, ErrorsSayWhatToChange) {
    EXPECT_THAT(error(of("missing.obj")), HasSubstr("missing.obj: is not a file"));
    write("a.obj", tetrahedron);
    Placement placement = of("a.obj");
    for (const char *target : {"tag36h11", "tag36h11:", ":3", "tag36h11:3x", "tag36h11:-1"}) {
        placement.target = target;
        EXPECT_THAT(error(placement), HasSubstr(std::string("--on ") + target + ": must be FAMILY:ID")) << target;
    }
    placement = of("a.obj");
    placement.source = "a.mp4";
    EXPECT_THAT(error(placement), HasSubstr("--camera is missing: the calibration of the camera that took a.mp4"));
}

} // namespace
} // namespace arhost::place
