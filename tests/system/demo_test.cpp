// SPDX-License-Identifier: Apache-2.0
//
// Tests of the demonstration (config/demo.yaml), and of videos that the real plugins write and read.
#include "arhost_run.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include <algorithm>
#include <functional>
#include <sched.h>
#include <sys/mount.h>

using namespace arhost::test;
using testing::HasSubstr;

namespace {

int frames_of(const std::filesystem::path &file) {
    cv::VideoCapture video(file.string());
    cv::Mat picture;
    int count = 0;
    while (video.read(picture))
        ++count;
    return count;
}

std::string video_yaml(const std::string &outputs) {
    return "version: 1\nsource: {plugin: source_synthetic, options: {frames: 40, width: 160, height: 120}}\n"
           "outputs:\n" +
           outputs;
}

} // namespace

TEST(Demo, WritesItsFourFiles) {
    ArhostRun run;
    std::filesystem::copy(arhost::test::source_directory() + "/config", run.path("config"),
                          std::filesystem::copy_options::recursive);
    ASSERT_EQ(run.run({"--config", "config/demo.yaml", "--frames", "42"}), 0) << run.output();
    EXPECT_EQ(frames_of(run.path("out/demo.mp4")), 42);
    const cv::Mat picture = cv::imread(run.path("out/demo.png").string());
    ASSERT_EQ(picture.size(), cv::Size(1280, 720));
    cv::Mat red; // only the virtual sphere is this red
    cv::inRange(picture, cv::Scalar(0, 0, 120), cv::Scalar(60, 60, 255), red);
    EXPECT_GT(cv::countNonZero(red), 500);
    std::istringstream poses(run.read("out/demo.poses.jsonl"));
    int lines = 0;
    for (std::string line; std::getline(poses, line); ++lines)
        EXPECT_EQ(nlohmann::json::parse(line)["targets"][0]["name"], "tag36h11-0") << line;
    EXPECT_EQ(lines, 42);
    const auto stats = nlohmann::json::parse(run.read("out/demo.stats.json"));
    EXPECT_EQ(stats["frames"]["augmented"], 42);
}

// The source cannot keep up with 200 frames per second, so it skips some.
TEST(Film, ShowsTheFramesOfALiveRunAtTheirCaptureTimes) {
    ArhostRun run("version: 1\nmode: live\n"
                  "source: {plugin: source_synthetic, fps: 200, options: {frames: 100, width: 640, height: 360}}\n"
                  "outputs:\n- {plugin: sink_video, path: film.mp4, options: {preset: ultrafast}}\n"
                  "- {plugin: sink_poses, path: poses.jsonl}\nstats: stats.json\n");
    ASSERT_EQ(run.run(), 0) << run.output();
    std::vector<double> captured_ms;
    std::istringstream poses(run.read("poses.jsonl"));
    for (std::string line; std::getline(poses, line);)
        captured_ms.push_back(1e-6 * nlohmann::json::parse(line)["capture_ns"].get<double>());
    ASSERT_FALSE(captured_ms.empty());
    ASSERT_LT(captured_ms.size(), 100u) << "no frame was skipped";
    cv::VideoCapture film(run.path("film.mp4").string());
    std::vector<double> shown_ms;
    for (cv::Mat picture; film.read(picture);)
        shown_ms.push_back(film.get(cv::CAP_PROP_POS_MSEC));
    ASSERT_GT(shown_ms.size(), 1u);
    // Each output drops frames of its own if the machine is busy, but not the first one.
    const auto is_capture_time = [&](double ms) {
        return std::ranges::any_of(
            captured_ms, [&](double captured) { return std::abs(captured - captured_ms.front() - ms) <= 2.1; });
    };
    const auto stats = nlohmann::json::parse(run.read("stats.json"));
    const auto missing_poses = stats["frames"]["dropped"].value("sink_poses", std::ptrdiff_t(0));
    EXPECT_LE(std::ranges::count_if(shown_ms, std::not_fn(is_capture_time)), missing_poses) << stats.dump(1);
}

// Tests all components together: moving objects must be rendered at the capture time of the frame.
TEST(Motion, IsRenderedAtTheFramesTime) {
    const std::string yaml =
        "version: 1\nsource: {plugin: source_synthetic, fps: 30, options: {frames: 31, width: 320, height: 180}}\n"
        "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: "
        "80}]}\n"
        "raytracer: {plugin: rt_embree, scene: scene.yaml}\noutputs: [{plugin: sink_images, path: \"%04d.png\"}]\n";
    const auto scene = [](const std::string &object) {
        return "version: 1\naxes: z-up\nambient: 0.5\nmaterials: {m: {model: diffuse, diffuse: \"#20a0f0\"}}\n"
               "lights: [{position: [-100, -100, 300], intensity: 0.6, falloff: none}]\n"
               "objects:\n  - {plane: {size: 300}, material: m, role: catcher}\n  - {cuboid: {size: [20, 20, 30]}, "
               "material: m, " +
               object + "}\n";
    };
    ArhostRun moving(yaml), still(yaml);
    moving.write(
        "scene.yaml",
        scene("motion: {keys: [{at_s: 0}, {at_s: 2, translate: [60, 0, 40]}, {at_s: 3, translate: [0, 0, 0]}]}"));
    still.write("scene.yaml", scene("transform: [{translate: [30, 0, 20]}]")); // the position at 1 s
    ASSERT_EQ(moving.run(), 0) << moving.output();
    ASSERT_EQ(still.run(), 0) << still.output();
    const auto different_pixels = [&](const char *name) {
        const cv::Mat a = cv::imread(moving.path(name).string()), b = cv::imread(still.path(name).string());
        cv::Mat difference, grey;
        cv::absdiff(a, b, difference);
        cv::cvtColor(difference, grey, cv::COLOR_BGR2GRAY);
        return cv::countNonZero(grey > 8);
    };
    EXPECT_LT(different_pixels("0030.png"), 20) << "silhouettes may differ, as one object is a moved instance";
    EXPECT_GT(different_pixels("0000.png"), 500);
    EXPECT_GT(different_pixels("0020.png"), 200);
}

TEST(VideoFile, ATruncatedInputSetsTheExitStatus) {
    ArhostRun run(video_yaml("- {plugin: sink_video, path: video.mkv}\n"));
    ASSERT_EQ(run.run(), 0) << run.output();
    ASSERT_EQ(frames_of(run.path("video.mkv")), 40);
    const std::string video = run.read("video.mkv");
    run.write("video.mkv", video.substr(0, video.size() * 6 / 10));
    run.write("again.yaml", "version: 1\nsource: {plugin: source_file, path: video.mkv}\n"
                            "outputs: [{plugin: sink_poses, path: poses.jsonl}]\nstats: stats.json\n");
    run.expect({"--config", "again.yaml"}, 1,
               {"video.mkv' is truncated: it ends after frame ",
                "again.yaml:2:9: source: the input is truncated; the frames before the truncation are kept"});
    const std::string poses = run.read("poses.jsonl");
    const auto kept = std::count(poses.begin(), poses.end(), '\n');
    EXPECT_GT(kept, 10);
    EXPECT_LT(kept, 40);
    EXPECT_EQ(run.stats()["frames"]["composited"], kept);
}

TEST(VideoFile, AFullDiskFailsItButOtherOutputsContinue) {
    ArhostRun run(video_yaml("- {plugin: sink_video, path: full/video.mp4}\n"
                             "- {plugin: sink_images, path: \"full/%04d.png\"}\n"
                             "- {plugin: sink_images, path: \"%04d.png\"}\n"));
    std::filesystem::create_directory(run.path("full"));
    constexpr int no_mount = 99;
    run.start({"--config", "run.yaml"}, [] {
        if (::unshare(CLONE_NEWNS) != 0 || ::mount("", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
            ::mount("none", "full", "tmpfs", 0, "size=64k") != 0)
            ::_exit(no_mount);
    });
    const int status = run.wait();
    if (status == no_mount)
        GTEST_SKIP() << "this user may not mount a tmpfs";
    EXPECT_EQ(status, 1);
    EXPECT_THAT(run.output(), HasSubstr("full/.%04d.png.partial': No space left"));
    EXPECT_THAT(run.output(), HasSubstr("sink_video"));
    EXPECT_THAT(run.output(), HasSubstr("No space left on device (free some space, or choose another path)"));
    EXPECT_TRUE(run.exists("0039.png"));
}
