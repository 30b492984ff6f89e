// SPDX-License-Identifier: Apache-2.0
//
// Tests that pictures have no ghosts: the memory of rt_embree must not show after something else has changed.
// The first picture after each event is compared with the first one of a new run.
#include "arhost_run.hpp"

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

using namespace arhost::test;

namespace {

// `ball`: the place of a ball on a table, and more of its keys.
std::string scene_with(const std::string &ball) {
    return "version: 2\naxes: z-up\nbackground: 0.3\n"
           "lights: [{type: sphere, position: [-160, -140, 260], radius: 20, intensity: 1}]\n"
           "materials: {paper: {model: diffuse, diffuse: 0.7}, red: {model: diffuse, diffuse: [0.7, 0.1, 0.1]}}\n"
           "objects:\n- {name: table, plane: {size: 500}, material: paper, role: catcher}\n"
           "- {name: ball, sphere: {centre: " +
           ball + ", material: red}\n";
}
const std::string left = scene_with("[-45, 0, 30], radius: 20}"), right = scene_with("[45, 0, 30], radius: 20}");

std::string configuration(const std::string &source, const std::string &raytracer = "rt_embree") {
    return "version: 1\nsource: {plugin: source_synthetic, fps: 100, options: {id: 3, width: 160, height: 120, "
           "noise: 0, " +
           source +
           "}}\ntracker: {plugin: tracker_aruco, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}\n"
           "raytracer: {plugin: " +
           raytracer +
           ", scene: scene.yaml}\n"
           "outputs: [{plugin: sink_images, path: \"out/%06d.png\"}, {plugin: sink_poses, path: out/poses.jsonl}]\n";
}
constexpr const char *still = "path: still, frames: 0";

std::string picture_name(std::size_t frame) {
    return "out/" + std::to_string(1'000'000 + frame).substr(1) + ".png";
}
cv::Mat picture(const ArhostRun &run, std::size_t frame) {
    cv::Mat picture = cv::imread(run.path(picture_name(frame)).string());
    EXPECT_FALSE(picture.empty()) << frame;
    return picture;
}
// Mean of the absolute differences, in codes.
double difference(const cv::Mat &a, const cv::Mat &b) {
    return cv::norm(a, b, cv::NORM_L1) / static_cast<double>(a.total() * static_cast<std::size_t>(a.channels()));
}

// The first picture of a new run.
cv::Mat first_picture(const std::string &scene) {
    ArhostRun run(configuration(still));
    run.write("scene.yaml", scene);
    EXPECT_EQ(run.run({"run.yaml", "--frames", "1"}), 0) << run.output();
    return picture(run, 0);
}

// A run whose files are edited. Its camera rests.
class EditedRun : public ArhostRun {
public:
    EditedRun() : ArhostRun(configuration(still)) {
        write("scene.yaml", left);
        start({"run.yaml", "--watch"});
        wait_for_more();
    }
    // Replaces a file as most editors do, and waits until the run has applied the edit and shown some frames more.
    void edit(const std::string &file, const std::string &text) {
        const std::size_t edits = applied();
        write(file + "~", text);
        std::filesystem::rename(path(file + "~"), path(file));
        EXPECT_TRUE(eventually([&] { return applied() > edits; })) << output();
        wait_for_more();
    }
    // Ends the run. Returns the number of pictures.
    std::size_t end() {
        send_signal(pid(), SIGINT);
        EXPECT_EQ(wait(), 130) << output();
        std::size_t count = 0;
        while (exists(picture_name(count)))
            ++count;
        return count;
    }

private:
    std::size_t applied() const {
        const std::string log = output();
        std::size_t count = 0;
        for (std::size_t at = 0; (at = log.find("raytracer is now", at)) != std::string::npos; ++at)
            ++count;
        return count;
    }
    void wait_for_more() {
        EXPECT_TRUE(wait_for_lines(lines("out/poses.jsonl") + 12, "out/poses.jsonl")) << output();
    }
};

} // namespace

// With what an earlier frame knew of the light, the shadow of the other ball would remain for some frames.
TEST(History, ANewSceneShowsNothingOfTheEarlierOne) {
    const cv::Mat before = first_picture(left), after = first_picture(right);
    EditedRun run;
    run.edit("scene.yaml", right);
    const std::size_t count = run.end();
    std::size_t first = 0;
    while (first < count && difference(picture(run, first), before) < difference(picture(run, first), after))
        ++first;
    ASSERT_LT(first, count) << run.output();
    EXPECT_GT(first, 0u);
    EXPECT_LT(difference(picture(run, first), after), 0.1 * difference(before, after));
}

TEST(History, ARayTracerThatReturnsHasForgottenWhatItShowed) {
    const cv::Mat before = first_picture(left), after = first_picture(right);
    EditedRun run;
    run.edit("run.yaml", configuration(still, "rt_counter"));
    run.edit("scene.yaml", right);
    run.edit("run.yaml", configuration(still));
    const std::size_t count = run.end();
    const auto is_other = [&](std::size_t frame) { // rt_counter draws a square
        return cv::norm(picture(run, frame).at<cv::Vec3b>(6, 6), after.at<cv::Vec3b>(6, 6), cv::NORM_INF) > 20;
    };
    std::size_t first = count;
    while (first > 0 && !is_other(first - 1))
        --first;
    ASSERT_GT(first, 0u) << run.output();
    ASSERT_LT(first, count) << run.output();
    EXPECT_LT(difference(picture(run, first), after), 0.1 * difference(before, after));
}

// While a postcard covers the marker, the ball moves. In the other run, the marker is covered from the beginning.
TEST(History, AMarkerThatIsFoundAgainShowsNothingOfThePast) {
    const std::string scene =
        scene_with("[-45, 0, 30], radius: 20}, motion: {keys: [{at_s: 0}, {at_s: 0.5, translate: "
                   "[90, 0, 0]}, {at_s: 20, translate: [90, 0, 0]}]}");
    ArhostRun run(configuration("frames: 60, period: 20, occlude_from: 14, occlude_to: 40")),
        late(configuration("frames: 60, period: 20, occlude_from: 0, occlude_to: 40"));
    for (ArhostRun *each : {&run, &late}) {
        each->write("scene.yaml", scene);
        ASSERT_EQ(each->run(), 0) << each->output();
    }
    std::vector<std::size_t> with_overlay;
    std::istringstream log(run.read("out/poses.jsonl"));
    std::size_t frame = 0;
    for (std::string line; std::getline(log, line); ++frame)
        if (nlohmann::json::parse(line)["overlay"] == "rendered")
            with_overlay.push_back(frame);
    const auto found = std::ranges::adjacent_find(with_overlay, [](auto a, auto b) { return b > a + 20; });
    ASSERT_NE(found, with_overlay.end()) << "the marker must be lost";
    const std::size_t again = found[1];
    EXPECT_LT(difference(picture(run, again), picture(late, again)), 0.2) << "frame " << again;
}
