// SPDX-License-Identifier: Apache-2.0
//
// Tests of `arhost --watch`, which applies edits while the video runs (docs/control.md).
#include "arhost_run.hpp"

#include <gmock/gmock.h>

using namespace arhost::test;
using testing::HasSubstr;
using testing::Not;

namespace {

constexpr const char *source =
    "source: {plugin: source_synthetic, fps: 100, options: {frames: 0, id: 0, side_mm: 80, "
    "width: 160, height: 120}}\n";
constexpr const char *tracker =
    "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n";
// Images do not depend on earlier ones.
constexpr const char *raytracer =
    "raytracer: {plugin: rt_embree, scene: scene.yaml, options: {quality: reference, samples: 1}}\n";

// A sphere of a colour, or an object of a mesh file.
std::string scene_with(const std::string &object) {
    return "version: 1\naxes: z-up\nmaterials: {m: {model: diffuse, diffuse: [0, 0.5, 0]}}\n"
           "objects: [{" +
           object + ", material: m}]\n";
}
const std::string small_sphere = scene_with("sphere: {centre: [0, 0, 10], radius: 10}");
const std::string large_sphere = scene_with("sphere: {centre: [0, 0, 30], radius: 30}");

class WatchedRun : public ArhostRun {
public:
    explicit WatchedRun(const std::string &scene = small_sphere) {
        write("scene.yaml", scene);
        write("run.yaml", configuration());
    }
    static std::string configuration(const std::string &tracker_line = tracker,
                                     const std::string &raytracer_line = raytracer, const std::string &more = "") {
        return std::string("version: 1\n") + source + tracker_line + raytracer_line +
               "outputs: [{plugin: sink_images, path: out/%06d.png}]\n" + more;
    }
    void start_watching() {
        start({"run.yaml", "--watch"});
        EXPECT_TRUE(eventually([this] { return exists("out/000002.png"); })) << output();
    }
    // Waits until the log contains `text` for the `count`th time.
    void wait_for(const std::string &text, int count = 1) {
        const auto found = [&] {
            const std::string log = output();
            int times = 0;
            for (std::size_t at = 0; (at = log.find(text, at)) != std::string::npos; ++at)
                ++times;
            return times >= count;
        };
        if (!eventually(found))
            throw std::runtime_error("the log lacks '" + text + "': " + output());
    }
    // Replaces a file as most editors do.
    void replace(const std::string &name, const std::string &text) const {
        write(name + "~", text);
        std::filesystem::rename(path(name + "~"), path(name));
    }
    // Interrupts the run after some more frames.
    int interrupt() {
        const int goal = std::stoi(last_picture()) + 4;
        EXPECT_TRUE(eventually([&] { return std::stoi(last_picture()) >= goal; })) << output();
        send_signal(pid(), SIGINT);
        return wait();
    }
    std::string last_picture() const {
        std::vector<std::string> names;
        for (const auto &entry : std::filesystem::directory_iterator(path("out")))
            names.push_back(entry.path().filename());
        return *std::ranges::max_element(names);
    }
};

// The picture that a run of the same files, without edits, writes under this name.
std::string picture_of_a_fresh_run(const WatchedRun &edited, const std::string &name) {
    ArhostRun run(edited.read("run.yaml"));
    for (const char *file : {"scene.yaml", "other.yaml", "mesh.obj"})
        if (edited.exists(file))
            run.write(file, edited.read(file));
    EXPECT_EQ(run.run({"run.yaml", "--frames", std::to_string(std::stoi(name) + 1)}), 0) << run.output();
    return run.read("out/" + name);
}

} // namespace

TEST(Watch, AnEditedSceneReplacesTheScene) {
    WatchedRun run;
    run.start_watching();
    run.write("scene.yaml", large_sphere);
    run.wait_for("raytracer is now rt_embree with the scene scene");
    EXPECT_EQ(run.interrupt(), 130) << run.output();
    EXPECT_EQ(run.read("out/" + run.last_picture()), picture_of_a_fresh_run(run, run.last_picture()));
    EXPECT_NE(run.read("out/000000.png"), picture_of_a_fresh_run(run, "000000.png"));
}

TEST(Watch, AnEditOfTheIntegratorReplacesTheFormOfImages) {
    WatchedRun run;
    const std::string whitted = run.read("scene.yaml");
    std::string path = whitted;
    path.replace(path.find("version: 1"), 10, "version: 2");
    run.start_watching();
    int edits = 0;
    for (const std::string &scene : {path, whitted, path}) {
        run.replace("scene.yaml", scene);
        run.wait_for("raytracer is now rt_embree with the scene scene", ++edits);
        const int goal = std::stoi(run.last_picture()) + 3; // images of this form
        EXPECT_TRUE(run.eventually([&] { return std::stoi(run.last_picture()) >= goal; })) << run.output();
    }
    EXPECT_EQ(run.interrupt(), 130) << run.output();
    EXPECT_EQ(run.read("out/" + run.last_picture()), picture_of_a_fresh_run(run, run.last_picture()));
}

TEST(Watch, AnEditedMeshReplacesTheScene) {
    const auto triangle = [](const std::string &height) {
        return "v -20 -20 1\nv 20 -20 1\nv 0 20 " + height + "\nf 1 2 3\n";
    };
    WatchedRun run(scene_with("mesh: mesh.obj"));
    run.write("mesh.obj", triangle("1"));
    run.start_watching();
    run.replace("mesh.obj", triangle("30"));
    run.wait_for("raytracer is now rt_embree with the scene scene");
    EXPECT_EQ(run.interrupt(), 130) << run.output();
    EXPECT_EQ(run.read("out/" + run.last_picture()), picture_of_a_fresh_run(run, run.last_picture()));
}

TEST(Watch, EditedComponentsReplaceTheRunningOnes) {
    WatchedRun run;
    run.start_watching();
    run.replace("run.yaml",
                WatchedRun::configuration(
                    "tracker: {plugin: tracker_apriltag, targets: [{marker: 0, family: tag36h11, side_mm: 40}]}\n",
                    "raytracer: {plugin: rt_embree, scene: scene.yaml, options: {samples: 4}}\n"));
    run.wait_for("tracker is now tracker_apriltag");
    run.wait_for("raytracer is now rt_embree");
    EXPECT_EQ(run.interrupt(), 130) << run.output();
    EXPECT_EQ(run.read("out/" + run.last_picture()), picture_of_a_fresh_run(run, run.last_picture()));
    EXPECT_THAT(run.output(), Not(HasSubstr("takes effect in the next run")));
}

TEST(Watch, EditedCoordinatesApplyToTheNextFrames) {
    WatchedRun run;
    run.start_watching();
    run.replace("run.yaml", WatchedRun::configuration(
                                tracker, raytracer,
                                "coordinates: {ar: 1, rt: 2, rotations: [{degrees: 90, axis: [1, 0, 0]}]}\n"));
    run.wait_for("raytracer is now rt_embree");
    EXPECT_EQ(run.interrupt(), 130) << run.output();
    EXPECT_EQ(run.read("out/" + run.last_picture()), picture_of_a_fresh_run(run, run.last_picture()));
}

TEST(Watch, AnInvalidEditLeavesTheRunAsItWas) {
    WatchedRun run;
    run.start_watching();
    run.replace("run.yaml", WatchedRun::configuration(tracker, "raytracer: {plugin: rt_embre, scene: scene.yaml}\n"));
    run.wait_for("run.yaml:4:21: raytracer.plugin: ");
    run.wait_for("the run continues with the previous configuration");
    run.replace("scene.yaml", scene_with("sphere: {centre: [0, 0, 30], radius: -30}"));
    run.wait_for("scene.yaml:4:");
    run.wait_for("the previous scene stays");
    run.replace("scene.yaml", large_sphere);
    run.wait_for("raytracer is now rt_embree with the scene scene");
    run.replace("run.yaml",
                WatchedRun::configuration(
                    tracker, "raytracer: {plugin: rt_embree, scene: scene.yaml, options: {samples: -1}}\n"));
    run.wait_for("the previous raytracer stays");
    run.replace("run.yaml", WatchedRun::configuration());
    run.wait_for("raytracer is now rt_embree with the scene scene", 2);
    EXPECT_EQ(run.interrupt(), 130) << run.output();
    EXPECT_EQ(run.read("out/" + run.last_picture()), picture_of_a_fresh_run(run, run.last_picture()));
}

TEST(Watch, ACorrectedSceneThatACommandHasLoadedStays) {
    WatchedRun run;
    run.write("other.yaml", large_sphere);
    std::string yaml = WatchedRun::configuration(tracker, raytracer, "scenes: [other.yaml]\n");
    const std::string outputs = "outputs: [";
    yaml.replace(yaml.find(outputs), outputs.size(),
                 outputs + "{plugin: sink_control, allow: [listen], control: [load_scene, set]}, ");
    run.write("run.yaml", yaml);
    std::filesystem::create_directory(run.path("runtime"));
    ::setenv("XDG_RUNTIME_DIR", run.path("runtime").c_str(), 1);
    run.start_watching();
    const auto ctl = [](std::vector<std::string> words) {
        ArhostRun command;
        words.insert(words.begin(), "ctl");
        EXPECT_EQ(command.run(words), 0) << command.output();
    };
    ctl({"load_scene", "other"});
    run.wait_for("raytracer is now rt_embree with the scene other");
    ctl({"set", "raytracer", "samples", "2"});
    run.replace("other.yaml", scene_with("sphere: {centre: [0, 0, 30], radius: -30}"));
    run.wait_for("the previous scene stays");
    run.replace("other.yaml", small_sphere);
    run.wait_for("raytracer is now rt_embree with the scene other", 2);
    EXPECT_THAT(run.output(), Not(HasSubstr("with the scene scene")));
    // A command after a failed edit stays, too.
    run.replace("other.yaml", scene_with("sphere: {centre: [0, 0, 30], radius: -30}"));
    run.wait_for("the previous scene stays", 2);
    ctl({"load_scene", "scene"});
    run.wait_for("raytracer is now rt_embree with the scene scene");
    run.replace("run.yaml", yaml + "frames: 100000\n");
    run.wait_for("the edit of 'frames' takes effect in the next run");
    EXPECT_EQ(run.interrupt(), 130) << run.output();
    EXPECT_GT(run.output().rfind("with the scene scene"), run.output().rfind("with the scene other"));
}

constexpr const char *tracker_with_cup = "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, "
                                         "side_mm: 80}, {name: cup, marker: 1, family: tag36h11, side_mm: 40}]}\n";

TEST(Watch, AnEditThatRemovesTheTargetOfAnObjectWarns) {
    WatchedRun run(scene_with("sphere: {centre: [0, 0, 10], radius: 10}, on: cup"));
    run.write("run.yaml", WatchedRun::configuration(tracker_with_cup));
    run.start_watching();
    run.replace("run.yaml", WatchedRun::configuration());
    run.wait_for("scene.yaml:4:58: objects[0].on: there is no target 'cup'; the tracker looks for 'tag36h11-0' "
                 "(tag36h11 0); correct the name, or add the target; until then, objects on it are hidden");
    EXPECT_EQ(run.interrupt(), 130) << run.output();
}

TEST(Watch, AnEditThatRemovesATargetTogetherWithItsObjectsDoesNotWarn) {
    WatchedRun run(scene_with("sphere: {centre: [0, 0, 10], radius: 10}, on: cup"));
    run.write("other.yaml", small_sphere);
    run.write("run.yaml", WatchedRun::configuration(tracker_with_cup));
    run.start_watching();
    run.replace("run.yaml",
                WatchedRun::configuration(tracker, "raytracer: {plugin: rt_embree, scene: other.yaml}\n"));
    run.wait_for("tracker is now tracker_aruco");
    run.wait_for("raytracer is now rt_embree with the scene other");
    EXPECT_EQ(run.interrupt(), 130) << run.output();
    EXPECT_THAT(run.output(), Not(HasSubstr("there is no target")));
}

TEST(Watch, AnEditedPatternRestartsTheTracker) {
    const auto pattern = [](int side) {
        std::string text;
        for (int i = 0; i < 12 * side * side; ++i)
            text += i % side < side / 2 ? "0 " : "255 ";
        return text;
    };
    WatchedRun run;
    run.write("a.patt", pattern(16));
    run.write("run.yaml", WatchedRun::configuration("tracker: {plugin: tracker_pattern, targets: [{name: a, pattern: "
                                                    "a.patt, side_mm: 80}]}\n"));
    run.start_watching();
    run.replace("a.patt", pattern(8));
    run.wait_for("tracker is now tracker_pattern");
    run.replace("a.patt", "no pattern");
    run.wait_for("a.patt' is not a pattern of ARToolKit");
    run.wait_for("the previous tracker stays");
    run.write("a.patt", pattern(16));
    run.wait_for("tracker is now tracker_pattern", 2);
    run.interrupt();
}

TEST(Watch, AnEditedTrackerDoesNotRepeatTheHintsOfThePreviousOne) {
    const auto tracker_of = [](const std::string &markers) {
        return WatchedRun::configuration("tracker: {plugin: tracker_aruco, targets: [{" + markers +
                                         ", side_mm: 80}]}\n");
    };
    const std::string hint = "other markers were in view: tag36h11 0";
    WatchedRun run;
    run.write("run.yaml", tracker_of("marker: 3, family: tag25h9"));
    run.start({"run.yaml", "--watch", "-v"});
    run.wait_for(hint);
    run.replace("run.yaml", tracker_of("ids: 0-1, family: tag36h11"));
    run.wait_for("tracker is now tracker_aruco");
    run.interrupt();
    EXPECT_THAT(run.output(), testing::ContainsRegex("never seen in [0-9]+ frames: 'tag36h11-1' .tag36h11 1.\n"));
    EXPECT_EQ(run.output().rfind(hint), run.output().find(hint)) << run.output();
}

TEST(Watch, AnEditedPictureOfATargetRestartsTheTracker) {
    const std::filesystem::path pictures = source_directory() + "/docs/images";
    WatchedRun run;
    std::filesystem::copy_file(pictures / "board.jpg", run.path("a.jpg"));
    std::filesystem::create_symlink("a.jpg", run.path("link.jpg"));
    run.write("run.yaml", WatchedRun::configuration("tracker: {plugin: tracker_image, targets: [{name: a, image: "
                                                    "link.jpg, width_mm: 200}]}\n"));
    run.start_watching();
    std::filesystem::copy_file(pictures / "demo.jpg", run.path("a.jpg"),
                               std::filesystem::copy_options::overwrite_existing);
    run.wait_for("tracker is now tracker_image");
    run.interrupt();
}

TEST(Watch, AnEditOfTheSandboxNeedsANewRun) {
    WatchedRun run;
    run.start_watching();
    run.replace("run.yaml",
                WatchedRun::configuration(
                    "tracker: {plugin: tracker_apriltag, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n",
                    raytracer, "sandbox: none\n"));
    run.wait_for("an edit of 'sandbox' needs a new run; the run continues with the previous configuration");
    run.replace("run.yaml",
                WatchedRun::configuration(
                    "tracker: {plugin: tracker_apriltag, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n"));
    run.wait_for("tracker is now tracker_apriltag");
    EXPECT_EQ(run.interrupt(), 130) << run.output();
}

TEST(Watch, ACorrectedSceneCompletesAnEditThatFailed) {
    WatchedRun run;
    run.write("other.yaml", scene_with("sphere: {centre: [0, 0, 30], radius: -30}"));
    run.start_watching();
    run.replace("run.yaml",
                WatchedRun::configuration(
                    tracker, "raytracer: {plugin: rt_embree, scene: other.yaml, options: {samples: 4}}\n"));
    run.wait_for("the previous scene stays");
    run.replace("other.yaml", large_sphere);
    run.wait_for("raytracer is now rt_embree with the scene other");
    EXPECT_EQ(run.interrupt(), 130) << run.output();
    EXPECT_EQ(run.read("out/" + run.last_picture()), picture_of_a_fresh_run(run, run.last_picture()));
}

TEST(WatchConfiguration, RejectsAPluginThatCouldReplaceALinkToTheConfiguration) {
    ArhostRun run;
    run.write("own/run.yaml", std::string("version: 1\n") + source + tracker + raytracer +
                                  "outputs: [{plugin: sink_video, path: out/take.mkv}]\n");
    run.write("own/scene.yaml", small_sphere);
    std::filesystem::create_directory(run.path("out"));
    std::filesystem::create_symlink("../own/run.yaml", run.path("out/run.yaml"));
    std::filesystem::create_symlink("../own/scene.yaml", run.path("out/scene.yaml"));
    run.expect({"out/run.yaml", "--watch"}, 2, {"outputs[0]: may write to the folder of '"});
}

TEST(WatchConfiguration, RejectsAPluginThatCouldReplaceALinkInThePath) {
    ArhostRun run;
    run.write("own/run.yaml", std::string("version: 1\n") + source + tracker + raytracer +
                                  "outputs: [{plugin: sink_video, path: " + run.path("project").string() +
                                  "/take.mkv}]\n");
    run.write("own/scene.yaml", small_sphere);
    std::filesystem::create_directory(run.path("project"));
    std::filesystem::create_directory_symlink("../own", run.path("project/conf"));
    std::filesystem::create_directory_symlink("project/conf", run.path("chained"));
    for (const char *file : {"project/conf/run.yaml", "chained/run.yaml"}) {
        EXPECT_EQ(run.run({file, "--watch"}), 2) << file;
        EXPECT_THAT(run.output(), HasSubstr("outputs[0]: may write to the folder of '"));
    }
}

TEST(Watch, NamesTheKeysWhoseEditsNeedANewRun) {
    WatchedRun run;
    run.start_watching();
    run.replace("run.yaml", WatchedRun::configuration(tracker, raytracer, "stats: out/stats.json\nframes: 100000\n"));
    run.wait_for("the edit of 'frames', 'stats' takes effect in the next run");
    run.replace("run.yaml", WatchedRun::configuration("", raytracer, "trajectory: none.jsonl\n"));
    run.wait_for("none.jsonl");
    EXPECT_EQ(run.interrupt(), 130) << run.output();
    EXPECT_THAT(run.output(), Not(HasSubstr(" is now ")));
}

TEST(Watch, EditsWithoutTheOptionHaveNoEffect) {
    WatchedRun run;
    run.start({"run.yaml", "--frames", "100"});
    ASSERT_TRUE(run.eventually([&] { return run.exists("out/000002.png"); })) << run.output();
    run.write("scene.yaml", large_sphere);
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), Not(HasSubstr(" is now ")));
}

TEST(WatchConfiguration, RejectsAPluginThatCouldEditTheConfiguration) {
    ArhostRun run(std::string("version: 1\n") + source + tracker + raytracer +
                  "outputs:\n  - {plugin: sink_video, path: take.mkv}\n");
    run.write("scene.yaml", small_sphere);
    run.expect({"run.yaml", "--watch"}, 2, {"run.yaml:6:5: outputs[0]: may write to the folder of '"});
    EXPECT_EQ(run.run({"run.yaml", "--frames", "3"}), 0) << run.output();
}

TEST(WatchConfiguration, RejectsAnEditAfterWhichAPluginCouldEditTheConfiguration) {
    WatchedRun run;
    run.start_watching();
    run.replace("run.yaml",
                WatchedRun::configuration(tracker, raytracer, "record: {plugin: sink_video, path: t.mkv}\n"));
    run.wait_for("record: may write to the folder of");
    EXPECT_EQ(run.interrupt(), 130) << run.output();
}
