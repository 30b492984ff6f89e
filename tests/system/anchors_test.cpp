// SPDX-License-Identifier: Apache-2.0
//
// Objects that belong to targets other than the world.
#include "arhost_run.hpp"

#include <gmock/gmock.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <optional>

using namespace arhost::test;
using testing::HasSubstr;

namespace {

constexpr int width = 320, height = 240; // fx is the width

std::string configuration(const std::string &raytracer, const std::string &tracker_options = "", int frames = 12) {
    return "version: 1\nsource: {plugin: source_counter, options: {frames: " + std::to_string(frames) +
           ", width: 320, height: 240}}\n"
           "tracker: {plugin: tracker_body, targets: [{name: visor, body: head}, {name: glove, body: hand}], "
           "options: {" +
           tracker_options + "}}\nraytracer: {plugin: " + raytracer +
           (raytracer == "rt_vulkan" ? ", allow: [gpu]" : "") +
           ", scene: scene.yaml}\n"
           "outputs: [{plugin: sink_images, path: \"%04d.png\", options: {content: overlay}}]\nstats: stats.json\n";
}

// A red ball on the world and a green one on the glove, each to the left or right of its target's origin.
const char *const scene = R"(version: 1
axes: z-up
ambient: 1
materials:
  red: {model: diffuse, diffuse: [1, 0, 0]}
  green: {model: diffuse, diffuse: [0, 1, 0]}
objects:
  - {sphere: {centre: [-60, 0, 0], radius: 8}, material: red}
  - {sphere: {centre: [60, 0, 0], radius: 8}, material: green, on: glove}
)";

// The centre of the pixels of one colour in an overlay; std::nullopt if there are none.
std::optional<cv::Point2d> centre_of(const ArhostRun &run, int frame, int channel) {
    char name[16];
    std::snprintf(name, sizeof name, "%04d.png", frame);
    const cv::Mat overlay = cv::imread(run.path(name).string(), cv::IMREAD_UNCHANGED);
    EXPECT_EQ(overlay.type(), CV_8UC4) << name;
    cv::Point2d sum;
    int count = 0;
    for (int y = 0; y < overlay.rows; ++y)
        for (int x = 0; x < overlay.cols; ++x)
            if (const auto pixel = overlay.at<cv::Vec4b>(y, x); pixel[3] == 255 && pixel[channel] > 100) {
                sum += cv::Point2d(x, y);
                ++count;
            }
    return count ? std::optional(sum / count) : std::nullopt;
}

// Where tracker_body's target with this index shows a point on its x axis in the frame n: turned by n/100 rad.
cv::Point2d pixel_of(int target, int n, double x_mm) {
    const double x = n + std::cos(n / 100.0) * x_mm, y = 20.0 * target, z = -500 - std::sin(n / 100.0) * x_mm;
    return {(width - 1) / 2.0 + width * x / -z, (height - 1) / 2.0 - width * y / -z};
}

constexpr int green = 1, red = 2; // channels, B, G, R

void expect_near(const std::optional<cv::Point2d> &actual, cv::Point2d expected, const std::string &what) {
    ASSERT_TRUE(actual) << what;
    EXPECT_LT(cv::norm(*actual - expected), 0.5) << what << *actual << expected;
}

class Anchors : public testing::TestWithParam<const char *> {};

} // namespace

TEST_P(Anchors, ObjectsFollowTheirTargets) {
    ArhostRun run(configuration(GetParam()));
    run.write("scene.yaml", scene);
    ASSERT_EQ(run.run(), 0) << run.output();
    for (int frame = 0; frame < 12; ++frame) {
        expect_near(centre_of(run, frame, red), pixel_of(0, frame, -60), "world, frame " + std::to_string(frame));
        expect_near(centre_of(run, frame, green), pixel_of(1, frame, 60), "glove, frame " + std::to_string(frame));
    }
}

TEST_P(Anchors, ObjectsOnALostTargetAreHidden) {
    ArhostRun run(configuration(GetParam(), "lost_from: 4, lost_to: 8, lost_target: 1"));
    run.write("scene.yaml", scene);
    ASSERT_EQ(run.run(), 0) << run.output();
    for (int frame = 0; frame < 12; ++frame) {
        expect_near(centre_of(run, frame, red), pixel_of(0, frame, -60), "world, frame " + std::to_string(frame));
        EXPECT_EQ(centre_of(run, frame, green).has_value(), frame < 4 || frame >= 8) << frame;
    }
}

// The pose of the world then follows from the relation of the two targets.
TEST_P(Anchors, ObjectsStayOnTheirTargetsWhileTheWorldIsLost) {
    ArhostRun run(configuration(GetParam(), "lost_from: 4, lost_to: 8, lost_target: 0"));
    run.write("scene.yaml", scene);
    ASSERT_EQ(run.run(), 0) << run.output();
    for (int frame = 0; frame < 12; ++frame)
        expect_near(centre_of(run, frame, green), pixel_of(1, frame, 60), "glove, frame " + std::to_string(frame));
}

INSTANTIATE_TEST_SUITE_P(RayTracers, Anchors, testing::Values("rt_embree", "rt_vulkan"),
                         [](const auto &info) { return std::string(info.param); });

TEST(AnchorErrors, ATargetThatDoesNotExistIsAnErrorAtTheKeyOfTheObject) {
    ArhostRun run(configuration("rt_embree"));
    run.write("scene.yaml", "version: 1\naxes: z-up\nmaterials: {grey: {model: diffuse, diffuse: 1}}\nobjects:\n"
                            "  - {sphere: {radius: 8}, material: grey, on: glove}\n"
                            "  - {sphere: {radius: 8}, material: grey, on: cup}\n");
    for (const std::vector<std::string> &arguments :
         {std::vector<std::string>{"run.yaml"}, {"check", "run.yaml"}, {"check", "--no-open", "run.yaml"}}) {
        run.expect(arguments, 2,
                   {"scene.yaml:6:47: objects[1].on: there is no target 'cup'; the tracker "
                    "looks for 'visor' (body 'head'), 'glove' (body 'hand'); correct the "
                    "name, or add the target"});
    }
    run.write("scene.yaml", scene);
    EXPECT_EQ(run.run({"check", "--no-open", "run.yaml"}), 0) << run.output();
}

TEST(AnchorErrors, AnObjectOnATargetNeedsATracker) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 2}}\ntrajectory: path.jsonl\n"
                  "raytracer: {plugin: rt_embree, scene: scene.yaml}\noutputs: [{plugin: sink_null}]\n");
    run.write("path.jsonl",
              R"({"format": "arhost-trajectory", "version": 1, "unit": "mm", "clock": "media", "fps": 30, )"
              R"("camera": {"width": 320, "height": 240, "fx": 320, "fy": 320}})"
              "\n"
              R"({"frame": 0, "capture_ns": 0, "eye": null, "look_at": null, "up": null})"
              "\n");
    run.write("scene.yaml", scene);
    run.expect({"check", "--no-open", "run.yaml"}, 2,
               {"scene.yaml:9:68: objects[1].on: no tracker runs that could find the target "
                "'glove'; remove this key, or run a tracker with this target"});
}

TEST(AnchorErrors, AKilledRayTracerKeepsObjectsOnTheirTargets) {
    ArhostRun clean(configuration("rt_embree", "", 60)), killed(configuration("rt_embree", "", 60));
    for (ArhostRun *run : {&clean, &killed})
        run->write("scene.yaml", scene);
    ASSERT_EQ(clean.run(), 0) << clean.output();
    killed.start();
    for (const char *frame : {"0010.png", "0030.png"}) {
        ASSERT_TRUE(killed.eventually([&] { return killed.exists(frame); })) << killed.output();
        ::kill(killed.worker("rt_embree"), SIGKILL);
    }
    ASSERT_EQ(killed.wait(), 0) << killed.output();
    for (int frame = 0; frame < 60; ++frame) {
        char name[16];
        std::snprintf(name, sizeof name, "%04d.png", frame);
        EXPECT_EQ(clean.read(name), killed.read(name)) << name;
    }
}
