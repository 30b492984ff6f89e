// SPDX-License-Identifier: Apache-2.0
#include "errors.hpp"
#include "plugin_under_test.hpp"
#include "run_config/configuration.hpp"

#include <gmock/gmock.h>

#include <fstream>

using namespace arhost;
using testing::ElementsAre;
using testing::IsEmpty;
namespace fs = std::filesystem;

namespace {

// Parses configurations; their plugins are empty files.
struct Warnings : testing::Test {
    Warnings() {
        for (const char *plugin : {"source_x.so", "tracker_x.so"})
            std::ofstream(scratch.path() / plugin) << "";
    }
    std::vector<std::string> of(const std::string &camera, const std::string &side_mm) const {
        const auto root = yaml::Node::parse(
            "version: 1\nsource: {plugin: source_x}\ncamera: " + camera +
                "\ntracker: {plugin: tracker_x, targets: [{marker: 0, family: t, side_mm: " + side_mm + "}]}\n",
            (scratch.path() / "lab.yaml").string());
        std::vector<std::string> warnings = run_config::parse(root, scratch.path()).warnings;
        for (std::string &warning : warnings)
            warning = test::without_folder(warning, scratch.path());
        return warnings;
    }
    test::ScratchFolder scratch;
    const std::string camera = "{width: 640, height: 480, fx: 600}";
};

} // namespace

// Configurations of a ray tracer.
struct Composite : testing::Test {
    Composite() {
        for (const char *file : {"source_x.so", "tracker_x.so", "rt_x.so", "scene.yaml"})
            std::ofstream(scratch.path() / file) << "";
    }
    std::optional<arhost_compositing> of(const std::string &keys) const {
        const auto root = yaml::Node::parse("version: 1\nsource: {plugin: source_x}\n"
                                            "tracker: {plugin: tracker_x, targets: [{marker: 0, family: t, side_mm: "
                                            "80}]}\n"
                                            "raytracer: {plugin: rt_x, scene: scene.yaml" +
                                                keys + "}\n",
                                            (scratch.path() / "lab.yaml").string());
        return run_config::parse(root, scratch.path()).raytracer.value().composite;
    }
    std::string error_of(const std::string &keys) const {
        return test::without_folder(test::error_of([&] { of(keys); }), scratch.path());
    }
    test::ScratchFolder scratch;
};

TEST_F(Composite, IsTheSpaceOfBlendingOrUpToTheScene) {
    EXPECT_EQ(of(""), std::nullopt);
    EXPECT_EQ(of(", composite: linear"), ARHOST_COMPOSITING_LINEAR);
    EXPECT_EQ(of(", composite: srgb"), ARHOST_COMPOSITING_SRGB);
}

TEST_F(Composite, ErrorsNameFileLineAndKey) {
    EXPECT_EQ(error_of(", composite: linaer"), "lab.yaml:4:57: raytracer.composite: 'linaer' is not one of linear, "
                                               "srgb; did you mean 'linear'?");
    EXPECT_THAT(error_of(", composite: [srgb]"), testing::HasSubstr("lab.yaml:4:57: raytracer.composite: "));
}

TEST_F(Warnings, AreForImplausibleFocalLengths) {
    EXPECT_THAT(of(camera, "80"), IsEmpty());
    EXPECT_THAT(of("{width: 640, height: 480, fx: 100}", "80"), IsEmpty());
    EXPECT_THAT(of("{width: 64, height: 48, fx: 60}", "80"), IsEmpty()) << "a small image";
    EXPECT_THAT(of("{width: 320, height: 240, fx: 90}", "80"), testing::SizeIs(1));
    EXPECT_THAT(of("{width: 640, height: 480, fx: 600, fy: 35.5}", "80"),
                ElementsAre("lab.yaml:3:9: camera: a focal length of 35.5 px is implausible for an image width of "
                            "640 px; check the unit, which is px"));
    std::ofstream(scratch.path() / "camera.yaml")
        << "{width: 640, height: 480, K: [99, 0, 320, 0, 99, 240, 0, 0, 1], D: [0, 0, 0, 0]}\n";
    EXPECT_THAT(of("{file: camera.yaml}", "80"),
                ElementsAre("lab.yaml:3:9: camera: a focal length of 99 px is implausible for an image width of 640 "
                            "px; check the unit, which is px"));
}

TEST_F(Warnings, AreForImplausibleSidesOfMarkers) {
    EXPECT_THAT(of(camera, "1"), IsEmpty());
    EXPECT_THAT(of(camera, "5000"), IsEmpty());
    EXPECT_THAT(of(camera, "0.08"), ElementsAre("lab.yaml:4:72: tracker.targets[0].side_mm: a print of 0.08 mm is "
                                                "implausible; check the unit, which is mm"));
    EXPECT_THAT(of(camera, "5001"), ElementsAre("lab.yaml:4:72: tracker.targets[0].side_mm: a print of 5001 mm is "
                                                "implausible; check the unit, which is mm"));
}
