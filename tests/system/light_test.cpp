// SPDX-License-Identifier: Apache-2.0
//
// Tests linear images and video for ray tracers, with rt_light: the colour of its square encodes the number of the
// frame that it got as video.
#include "arhost_run.hpp"

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

using namespace arhost::test;
using testing::HasSubstr;

namespace {

using Frames = std::set<std::uint64_t>;

std::string with_plugin(const std::string &plugin, std::string yaml) {
    return yaml.replace(yaml.find("rt_counter"), std::string("rt_counter").size(), plugin);
}

class LightRun : public ArhostRun {
public:
    explicit LightRun(const Counting &options, const std::string &plugin = "rt_light")
        : ArhostRun(with_plugin(plugin, counting(options))) {
        std::string scene = small_scene;
        write("scene.yaml", scene.replace(scene.find('1'), 1, "2"));
    }
};

} // namespace

TEST(LinearImages, ShowTheVideoOfTheirFrame) {
    LightRun run({.source = "frames: 300"});
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_EQ(expect_all_frames(run, 300), Frames{});
}

TEST(LinearImages, DarkenTheVideoInLinearLight) {
    LightRun run({.source = "frames: 256", .raytracer = "shades: true"});
    ASSERT_EQ(run.run(), 0) << run.output();
    const auto lines = counted(run);
    ASSERT_EQ(lines.size(), 256u);
    EXPECT_EQ(lines[255].video, 188u); // the code of half the light of 255
    EXPECT_EQ(lines[0].video, 0u);
}

TEST(LinearImages, KillingWorkersDoesNotChangeThem) {
    const Counting options{.source = "frames: 300, delay_ms: 1", .raytracer = "shades: true"};
    LightRun clean(options), run(options);
    ASSERT_EQ(clean.run(), 0) << clean.output();
    run.start();
    kill_in_turn(run, {"rt_light", "source_counter", "rt_light"});
    ASSERT_EQ(run.wait(), 0) << run.output();
    EXPECT_EQ(run.read("counted.txt"), clean.read("counted.txt"));
    EXPECT_EQ(run.stats()["restarts"]["raytracer"], 2);
}

// The random numbers of frames continue one sequence, glass shows the video of its frame, and the light of the other
// objects is that of earlier frames, too.
TEST(LinearImages, KillingRealWorkersEvery20FramesDoesNotChangeThem) {
    const std::string yaml =
        "version: 1\n"
        "source: {plugin: source_synthetic, options: {id: 3, width: 160, height: 120, frames: 160}}\n"
        "tracker: {plugin: tracker_aruco, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}\n"
        "raytracer: {plugin: rt_embree, scene: scene.yaml, options: {quality: realtime, threads: 2}}\n"
        "outputs: [{plugin: sink_poses, path: poses.jsonl}, {plugin: sink_images, path: \"%04d.png\"}]\n"
        "stats: stats.json\nrestart: {first_delay_ms: 1}\n";
    const std::string scene =
        "version: 2\naxes: z-up\nbackground: 0.2\n"
        "lights: [{type: sphere, position: [-160, -140, 260], radius: 20, intensity: 1}]\n"
        "materials: {paper: {model: diffuse, diffuse: 0.7}, red: {model: diffuse, diffuse: [0.7, 0.1, 0.1]}, "
        "glass: {model: glass, index: 1.5}}\n"
        "objects:\n- {name: table, plane: {size: 500}, material: paper, role: catcher}\n"
        "- {name: ball, sphere: {centre: [0, 0, 25], radius: 20}, material: glass}\n"
        "- {name: cube, cuboid: {size: [30, 30, 30], centre: [60, 0, 15]}, material: red, motion: "
        "{keys: [{at_s: 0}, {at_s: 2}, {at_s: 4, translate: [0, 60, 0]}]}}\n";
    ArhostRun clean(yaml), killed(yaml);
    for (const ArhostRun *run : {&clean, &killed})
        run->write("scene.yaml", scene);
    ASSERT_EQ(clean.run(), 0) << clean.output();
    killed.start();
    std::size_t kills = 0;
    for (std::size_t next = 20; killed.wait_for_lines(next, "poses.jsonl"); next = killed.lines("poses.jsonl") + 20)
        if (const pid_t worker = killed.wait_for_worker(kills++ % 2 == 0 ? "rt_embree" : "tracker_aruco"))
            send_signal(worker, SIGKILL);
    ASSERT_EQ(killed.wait(), 0) << killed.output();
    for (const char *stage : {"raytracer", "tracker"})
        EXPECT_GE(killed.stats()["restarts"][stage], 2) << stage;
    EXPECT_EQ(killed.read("poses.jsonl"), clean.read("poses.jsonl"));
    for (int frame = 0; frame < 160; ++frame) {
        const std::string name = std::to_string(10000 + frame).substr(1) + ".png";
        ASSERT_TRUE(clean.exists(name)) << name;
        ASSERT_EQ(killed.read(name), clean.read(name)) << name;
    }
}

TEST(LinearImages, AreNotRequestedFromAPluginWithoutThem) {
    LightRun run({.source = "frames: 30"}, "rt_counter");
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_EQ(expect_all_frames(run, 30), Frames{});
    EXPECT_THAT(run.output(), HasSubstr("rt_counter cannot write linear images"));
}

TEST(LinearImages, GiveWayToTheStraightImagesOfAFallback) {
    ArhostRun run(with_plugin("rt_light, fallback: rt_counter",
                              counting({.source = "frames: 60",
                                        .raytracer = "crash_at: 20",
                                        .more = "restart: {proven_after_frames: 1000, quarantine_after: 1}\n"})));
    std::string scene = small_scene;
    run.write("scene.yaml", scene.replace(scene.find('1'), 1, "2"));
    run.run();
    EXPECT_EQ(expect_all_frames(run, 60), Frames{});
    EXPECT_THAT(run.output(), HasSubstr("falling back to rt_counter"));
}

TEST(LinearImages, AreNotRequestedIfTheConfigurationBlendsCodes) {
    LightRun run({.source = "frames: 30"}, "rt_light, composite: srgb");
    run.expect(2, {"needs linear images and video"});
}

TEST(LinearImages, ANaNIsShownAsBlackAndReported) {
    LightRun run({.source = "frames: 60", .raytracer = "writes_nan: true"}, "rt_light, conform: true");
    run.run();
    const auto lines = counted(run);
    ASSERT_EQ(lines.size(), 60u) << run.output();
    for (const CountedLine &line : lines) {
        EXPECT_EQ(line.video, 0u) << line.sequence; // the last pixel
        EXPECT_EQ(line.overlay, std::to_string(line.sequence));
    }
    EXPECT_THAT(run.output(), HasSubstr("raytracer.light"));
    EXPECT_THAT(run.output(), HasSubstr("pixel (63, 47): value 4 is nan; it must be finite and not negative"));
}

TEST(LinearImages, AreEnlargedInModeLive) {
    LightRun run({.mode = "live",
                  .source = "frames: 90",
                  .raytracer = "delay_ms: 3", // no rate of 10,000 fps is possible
                  .more = "live: {target_fps: 10000, min_scale: 0.5}\n"});
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_EQ(run.stats()["quality"]["scale"], 0.5) << run.stats().dump(1);
    const auto lines = counted(run);
    ASSERT_FALSE(lines.empty());
    expect_own_overlays(lines); // also checks that the last pixel shows the unchanged video
}

TEST(LinearImages, ReachSinksOfTheOverlayAsStraightOnes) {
    std::string yaml = counting({.source = "frames: 4", .raytracer = "shades: true"});
    const std::string sink = "outputs: [{plugin: sink_counter, path: counted.txt}]";
    yaml.replace(yaml.find(sink), sink.size(),
                 "outputs: [{plugin: sink_images, path: \"%04d.png\", options: {content: overlay}}]");
    ArhostRun run(with_plugin("rt_light", yaml));
    std::string scene = small_scene;
    run.write("scene.yaml", scene.replace(scene.find('1'), 1, "2"));
    ASSERT_EQ(run.run(), 0) << run.output();
    const cv::Mat overlay = cv::imread(run.path("0003.png").string(), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(overlay.type(), CV_8UC4);
    for (int y = 0; y < overlay.rows; ++y)
        for (int x = 0; x < overlay.cols; ++x) {
            const auto pixel = overlay.at<cv::Vec4b>(y, x);
            if (x < 16 && y < 16)
                EXPECT_EQ(pixel, cv::Vec4b(170, 0, 3, 255)); // B, G, R, alpha of frame 3
            else if (x == overlay.cols - 1 && y == overlay.rows - 1)
                EXPECT_EQ(pixel, cv::Vec4b(0, 0, 0, 128)) << "half of the light is removed";
            else
                EXPECT_EQ(pixel[3], 0) << x << " " << y;
        }
}

TEST(LinearImages, AreNotRequestedForWhittedScenes) {
    LightRun run({.source = "frames: 30"});
    run.write("scene.yaml", small_scene);
    run.expect(2, {"needs linear images and video"});
}
