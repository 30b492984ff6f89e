// SPDX-License-Identifier: Apache-2.0
//
// Tests the registration of the complete system with lens distortion: compares the silhouette of a virtual plate in
// the augmented frames with the plate's projection, computed with the exact pose that the source reports.
#include "arhost_run.hpp"
#include "camera/lens_model.hpp"

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

using namespace arhost;
using namespace arhost::test;

namespace {

constexpr int frames = 50;
constexpr double half_side_mm = 45; // half the side of the plate, which is centred on the marker

arhost_intrinsics lens() {
    arhost_intrinsics i{};
    i.struct_size = sizeof i;
    i.width = 960;
    i.height = 540;
    i.fx = 760;
    i.fy = 755;
    i.cx = 489.3;
    i.cy = 262.8;
    i.distortion = ARHOST_DISTORTION_BROWN;
    i.coefficient_count = 5;
    const double coefficients[] = {-0.21, 0.09, 0.0012, -0.0008, 0.01};
    std::copy(std::begin(coefficients), std::end(coefficients), i.coefficients);
    return i;
}

std::string configuration(const std::string &tracker) {
    return "version: 1\nsource: {plugin: source_synthetic, fps: 5, options: {frames: " + std::to_string(frames) +
           ", family: tag36h11, id: 0, side_mm: 80}}\n"
           "camera: {width: 960, height: 540, fx: 760, fy: 755, cx: 489.3, cy: 262.8,\n"
           "  distortion: {model: brown, coefficients: [-0.21, 0.09, 0.0012, -0.0008, 0.01]}}\n"
           "tracker: {plugin: " +
           tracker +
           ", targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n"
           "raytracer: {plugin: rt_embree, scene: plate.yaml}\n"
           "outputs:\n- {plugin: sink_images, path: \"frames/%04d.png\"}\n- {plugin: sink_poses, path: "
           "poses.jsonl}\n";
}

// The plate is pure green under any light, so the silhouette can be found by colour.
const char *const plate = "version: 1\naxes: z-up\nambient: 1\n"
                          "materials: {green: {model: diffuse, diffuse: 0, ambient: [0, 1, 0]}}\n"
                          "objects: [{plane: {size: 90}, material: green}]\n";

// Returns the outline of the plate in the distorted image, in px. `mt` is the exact pose in OpenGL eye space.
std::vector<cv::Point2d> true_outline(const std::vector<double> &mt) {
    std::vector<cv::Point2d> outline;
    const double corners[5][2] = {{-1, 1}, {1, 1}, {1, -1}, {-1, -1}, {-1, 1}};
    for (int side = 0; side < 4; ++side)
        for (int step = 0; step < 100; ++step) {
            const double t = step / 100.0;
            const double x = half_side_mm * (corners[side][0] * (1 - t) + corners[side + 1][0] * t);
            const double y = half_side_mm * (corners[side][1] * (1 - t) + corners[side + 1][1] * t);
            const auto row = [&](std::size_t r) { return mt[r] * x + mt[4 + r] * y + mt[12 + r]; };
            const auto pixel = camera::project(lens(), {row(0), -row(1), -row(2)});
            outline.emplace_back(pixel->x, pixel->y);
        }
    return outline;
}

double distance_to_outline(cv::Point2d point, const std::vector<cv::Point2d> &outline) {
    double nearest = 1e9;
    for (std::size_t i = 0; i < outline.size(); ++i) {
        const cv::Point2d a = outline[i], b = outline[(i + 1) % outline.size()], ab = b - a;
        const double t = std::clamp((point - a).dot(ab) / std::max(ab.dot(ab), 1e-12), 0.0, 1.0);
        nearest = std::min(nearest, cv::norm(point - a - t * ab));
    }
    return nearest;
}

} // namespace

class Silhouette : public testing::TestWithParam<const char *> {};

TEST_P(Silhouette, MatchesTheExactPose) {
    ArhostRun run(configuration(GetParam()));
    run.write("plate.yaml", plate);
    ASSERT_EQ(run.run(), 0) << run.output();
    std::istringstream lines(run.read("poses.jsonl"));
    double sum_px = 0, worst_px = 0, area_error = 0;
    int seen = 0;
    for (std::string line; std::getline(lines, line);) {
        const auto record = nlohmann::json::parse(line);
        const std::vector<cv::Point2d> outline = true_outline(record["truth"]["mt"]);
        char name[32];
        std::snprintf(name, sizeof name, "frames/%04d.png", record["frame"].get<int>());
        const cv::Mat image = cv::imread(run.path(name).string());
        cv::Mat mask;
        cv::inRange(image, cv::Scalar(0, 255, 0), cv::Scalar(0, 255, 0), mask);
        std::vector<std::vector<cv::Point>> contours;
        cv::findContours(mask, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
        ASSERT_EQ(contours.size(), 1u) << name;
        // The outermost pixel centres are 0 to 1 px inside the plate's edge, on average 0.5 px.
        double frame_px = 0;
        for (const cv::Point &point : contours[0])
            frame_px += distance_to_outline(point, outline);
        frame_px /= static_cast<double>(contours[0].size());
        sum_px += frame_px;
        worst_px = std::max(worst_px, frame_px);
        std::vector<cv::Point2f> polygon(outline.begin(), outline.end());
        area_error += cv::countNonZero(mask) / cv::contourArea(polygon) - 1;
        ++seen;
    }
    ASSERT_EQ(seen, frames);
    std::printf("silhouette, %s, %d frames, Brown distortion: mean %.2f px, worst frame %.2f px (target 1 px mean); "
                "area %+.2f %%\n",
                GetParam(), seen, sum_px / seen, worst_px, 100 * area_error / seen);
    EXPECT_LE(sum_px / seen, 1.0);
    EXPECT_LE(std::abs(area_error / seen), 0.01) << "the silhouette is too large or too small";
}

INSTANTIATE_TEST_SUITE_P(Trackers, Silhouette, testing::Values("tracker_aruco", "tracker_apriltag"),
                         [](const auto &info) { return info.index == 0 ? "Aruco" : "AprilTag"; });

// No ray tracer reaches this frame rate, so the quality falls to its limits on every machine.
TEST(ReducedQuality, KeepsTheOverlayInPlace) {
    ArhostRun run("version: 1\nmode: live\nsource: {plugin: source_synthetic, fps: 15, options: {frames: 60, "
                  "family: tag36h11, id: 0, side_mm: 80}}\n"
                  "camera: {width: 960, height: 540, fx: 760, fy: 755, cx: 489.3, cy: 262.8,\n"
                  "  distortion: {model: brown, coefficients: [-0.21, 0.09, 0.0012, -0.0008, 0.01]}}\n"
                  "tracker: {plugin: tracker_apriltag, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n"
                  "raytracer: {plugin: rt_embree, scene: plate.yaml, options: {samples: 16}}\n"
                  "live: {target_fps: 10000, min_scale: 0.5, min_samples: 2, max_latency_ms: 60000}\n"
                  "outputs:\n- {plugin: sink_images, path: \"frames/%04d.png\"}\n"
                  "- {plugin: sink_poses, path: poses.jsonl}\nstats: stats.json\n");
    run.write("plate.yaml", plate);
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_EQ(run.stats()["quality"]["scale"], 0.5) << run.stats().dump(1);
    EXPECT_EQ(run.stats()["quality"]["samples"], 2);
    std::vector<std::string> lines;
    std::istringstream poses(run.read("poses.jsonl"));
    for (std::string line; std::getline(poses, line);)
        lines.push_back(line);
    ASSERT_GE(lines.size(), 3u);
    const auto record = nlohmann::json::parse(lines.back());
    char name[32];
    std::snprintf(name, sizeof name, "frames/%04d.png", record["frame"].get<int>());
    const cv::Mat image = cv::imread(run.path(name).string());
    cv::Mat mask; // at least half green, also where the plate covers only a part of a pixel
    cv::inRange(image, cv::Scalar(0, 190, 0), cv::Scalar(128, 255, 128), mask);
    std::vector<std::vector<cv::Point>> contours;
    cv::findContours(mask, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
    ASSERT_EQ(contours.size(), 1u) << name;
    const std::vector<cv::Point2d> outline = true_outline(record["truth"]["mt"]);
    double sum_px = 0;
    for (const cv::Point &point : contours[0])
        sum_px += distance_to_outline(point, outline);
    EXPECT_LE(sum_px / static_cast<double>(contours[0].size()), 1.0);
    const std::vector<cv::Point2f> polygon(outline.begin(), outline.end());
    EXPECT_NEAR(cv::countNonZero(mask) / cv::contourArea(polygon), 1, 0.02);
}
