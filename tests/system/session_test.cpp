// SPDX-License-Identifier: Apache-2.0
//
// Tests that record sessions with the real plugins and replay them.
#include "arhost_run.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <map>
#include <sched.h>
#include <sys/mount.h>

using namespace arhost::test;
using testing::HasSubstr;
using testing::Not;
using Json = nlohmann::json;

namespace {

const std::string scenes = arhost::test::source_directory() + "/config/scenes/";

// Returns a configuration of a small synthetic video in which the marker is occluded for some frames, and an output
// that records the session `take`. The folder `recorded` gets the images and poses.
std::string recording(const std::string &mode, const std::string &frames, const std::string &raytracer_options = "",
                      const std::string &session_options = "", const std::string &more = "") {
    return "version: 1\nmode: " + mode +
           "\nsource: {plugin: source_synthetic, fps: 30, options: {width: 320, height: 240, frames: " + frames +
           ", occlude_from: 12, occlude_to: 22}}\n"
           "tracker: {plugin: tracker_aruco, hold_frames: 5, targets: [{marker: 0, family: tag36h11, side_mm: "
           "80}]}\n"
           "raytracer: {plugin: rt_embree, scene: " +
           scenes + "optix-cs.yaml, options: {" + raytracer_options + "}, deadline_ms: 60000}\n" +
           "live: {max_latency_ms: 60000}\noutputs:\n- {plugin: sink_session, path: take, options: {" +
           session_options +
           "}}\n- {plugin: sink_images, path: \"recorded/%04d.png\"}\n- {plugin: sink_poses, path: "
           "recorded/poses.jsonl}\n" +
           more;
}

std::vector<std::string> replaying(std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {
        "replay", "take", "--set",
        "outputs=[{plugin: sink_images, path: \"replayed/%04d.png\"}, {plugin: sink_poses, path: "
        "replayed/poses.jsonl}]"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
}

std::map<std::string, std::string> files_in(const ArhostRun &run, const std::string &folder) {
    std::map<std::string, std::string> files;
    for (const auto &entry : std::filesystem::directory_iterator(run.path(folder)))
        files[entry.path().filename()] = read_file(entry.path());
    return files;
}

// Expects that the replayed images and poses have the same bytes as the recorded ones.
void expect_same(const ArhostRun &run) {
    const auto recorded = files_in(run, "recorded"), replayed = files_in(run, "replayed");
    ASSERT_GT(recorded.size(), 1u);
    EXPECT_EQ(recorded.size(), replayed.size());
    for (const auto &[name, bytes] : recorded) {
        ASSERT_TRUE(replayed.contains(name)) << name;
        EXPECT_TRUE(bytes == replayed.at(name)) << name << " differs";
    }
}

// Returns the whole lines of a log, without the one that ends it.
std::vector<Json> lines_of(const ArhostRun &run, const std::string &file) {
    std::istringstream text(run.read(file));
    std::vector<Json> lines;
    for (std::string line; std::getline(text, line) && !text.eof();)
        if (Json parsed = Json::parse(line); !parsed.contains("end"))
            lines.push_back(std::move(parsed));
    return lines;
}

void wait_for_frames(const ArhostRun &run, std::size_t count, const std::string &take = "take") {
    ASSERT_TRUE(run.wait_for_lines(count, take + "/frames.jsonl")) << run.output();
}

std::size_t count(const std::vector<Json> &lines, const std::string &overlay) {
    return static_cast<std::size_t>(
        std::ranges::count_if(lines, [&](const Json &line) { return line["overlay"] == overlay; }));
}

} // namespace

TEST(Sessions, AReplayShowsObjectsOnTheirTargets) {
    std::string yaml = recording("lockstep", "12");
    yaml.replace(yaml.find(scenes), scenes.size() + std::string("optix-cs.yaml").size(), "anchored.yaml");
    ArhostRun run(yaml);
    run.write("anchored.yaml", "version: 1\naxes: z-up\nambient: 1\nmaterials: {grey: {model: diffuse, diffuse: 1}}\n"
                               "objects: [{sphere: {radius: 8}, material: grey, on: tag36h11-0}]\n");
    ASSERT_EQ(run.run(), 0) << run.output();
    ASSERT_EQ(run.run(replaying({"--allow", "anchored.yaml"})), 0) << run.output();
    expect_same(run);
}

TEST(Sessions, AReplayReproducesPosesAndImagesOfLockstep) {
    ArhostRun run(recording("lockstep", "40"));
    ASSERT_EQ(run.run(), 0) << run.output();
    ASSERT_EQ(run.run(replaying()), 0) << run.output();
    EXPECT_EQ(run.messages().find("warning"), std::string::npos) << run.messages();
    expect_same(run);
    const auto lines = lines_of(run, "take/frames.jsonl");
    EXPECT_EQ(lines.size(), 40u);
    EXPECT_EQ(count(lines, "held"), 5u);
    EXPECT_GT(count(lines, "none"), 0u);
    // With a setting that differs, the tracker runs again.
    ASSERT_EQ(run.run(replaying({"--set", "tracker.deadline_ms=60000"})), 0) << run.output();
    expect_same(run);
}

// With 64 samples per pixel, the ray tracer cannot keep up on any machine. While a worker is down, frames pass
// without an overlay.
TEST(Sessions, AReplayRepeatsTheDecisionsOfALiveRun) {
#if defined(__SANITIZE_ADDRESS__)
    GTEST_SKIP() << "takes minutes under a sanitizer";
#endif
    ArhostRun run(
        recording("live", "0", "samples: 64", "", "restart: {proven_after_frames: 1000000, first_delay_ms: 300}\n"));
    run.start();
    wait_for_frames(run, 2);
    const pid_t killed = run.worker("tracker_aruco");
    send_signal(killed, SIGKILL);
    EXPECT_TRUE(run.eventually([&] { return run.worker("tracker_aruco") != killed && run.worker("tracker_aruco"); }));
    send_signal(run.worker("rt_embree"), SIGKILL);
    const auto recorded = [&] { return lines_of(run, "take/frames.jsonl"); };
    EXPECT_TRUE(run.eventually([&] {
        return std::ranges::any_of(recorded(), [](const Json &line) { // the ray tracer was down
            return line["overlay"] == "none" && !line["camera"].is_null();
        });
    })) << run.output();
    EXPECT_TRUE(run.eventually([&] { return recorded().back()["overlay"] == "rendered"; })) << run.output();
    send_signal(run.pid(), SIGTERM);
    ASSERT_EQ(run.wait(), 130) << run.output();
    EXPECT_LT(recorded().size(), recorded().back()["frame"].get<std::size_t>() + 1) << "frames must be dropped";
    ASSERT_EQ(run.run(replaying()), 0) << run.output();
    expect_same(run);
}

// Stops a run that has recorded five such frames.
template <class Predicate> void stop_after_five(ArhostRun &run, Predicate is_counted) {
    EXPECT_TRUE(run.eventually([&] {
        return run.exists("take/frames.jsonl") &&
               std::ranges::count_if(lines_of(run, "take/frames.jsonl"), is_counted) >= 5;
    })) << run.output();
    send_signal(run.pid(), SIGTERM);
    ASSERT_EQ(run.wait(), 130) << run.output();
}

TEST(Sessions, AReplayRepeatsTheReducedQualityOfALiveRun) {
#if defined(__SANITIZE_ADDRESS__)
    GTEST_SKIP() << "takes minutes under a sanitizer";
#endif
    ArhostRun run(recording("live", "0", "samples: 32"));
    run.start({"--config", "run.yaml", "--set", "live.target_fps=30"});
    const auto is_reduced = [](const Json &line) {
        return line.value("overlay_samples", 32) < 32 && line["overlay"] != "none";
    };
    stop_after_five(run, is_reduced);
    ASSERT_EQ(run.run(replaying()), 0) << run.output();
    expect_same(run);
}

// Each image also depends on those before. At this rate of the source, none is too late to be shown, and no output
// drops one.
TEST(Sessions, AReplayRepeatsTheReducedShadingOfALiveRun) {
#if defined(__SANITIZE_ADDRESS__)
    GTEST_SKIP() << "too slow under a sanitizer to show each image in time";
#endif
    std::string yaml = recording("live", "0");
    yaml.replace(yaml.find(scenes), scenes.size() + std::string("optix-cs.yaml").size(), "path.yaml");
    ArhostRun run(yaml);
    run.write("path.yaml",
              "version: 2\naxes: z-up\nbackground: 0.3\n"
              "materials: {paper: {model: diffuse, diffuse: 0.7}, red: {model: diffuse, diffuse: [0.7, 0.1, 0.1]}}\n"
              "objects:\n- {name: table, plane: {size: 500}, material: paper, role: catcher}\n"
              "- {name: ball, sphere: {centre: [0, 0, 25], radius: 25}, material: red}\n");
    // No ray tracer reaches this frame rate.
    run.start({"--config", "run.yaml", "--set", "live.target_fps=10000", "--set", "live.min_scale=1", "--set",
               "source.options.occlude_from=-1", "--set", "source.fps=10"});
    const auto is_reduced = [](const Json &line) {
        return line.value("overlay_shading_px", 1) == 2 && line["overlay"] != "none";
    };
    stop_after_five(run, is_reduced);
    ASSERT_EQ(run.run(replaying({"--allow", "path.yaml"})), 0) << run.output();
    expect_same(run);
}

TEST(Sessions, AReplayWithAnotherTrackerAndQualityRendersEveryFrameAnew) {
    ArhostRun run(recording("lockstep", "30"));
    ASSERT_EQ(run.run(), 0) << run.output();
    ASSERT_EQ(run.run(replaying({"--tracker", "tracker_apriltag", "--set", "raytracer.options.samples=2", "--set",
                                 "tracker.hold_frames=1"})),
              0)
        << run.output();
    const auto recorded = lines_of(run, "recorded/poses.jsonl"), replayed = lines_of(run, "replayed/poses.jsonl");
    ASSERT_EQ(replayed.size(), 30u);
    EXPECT_EQ(count(recorded, "held"), 5u);
    EXPECT_EQ(count(replayed, "held"), 1u);
    EXPECT_EQ(replayed[0]["targets"][0]["name"], "tag36h11-0");
    EXPECT_NE(replayed[0]["targets"], recorded[0]["targets"]);
    EXPECT_EQ(replayed[7]["capture_ns"], recorded[7]["capture_ns"]);
    EXPECT_NE(run.read("replayed/0000.png"), run.read("recorded/0000.png"));
}

TEST(Sessions, AConfigurationReplacesTheRecordedOne) {
    ArhostRun run(recording("lockstep", "10"));
    ASSERT_EQ(run.run(), 0) << run.output();
    run.write("other.yaml", "version: 1\nsource: {plugin: source_v4l2, allow: [video]}\n"
                            "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: "
                            "80}]}\noutputs: [{plugin: sink_window}]\n");
    ASSERT_EQ(run.run({"replay", "take", "--config", "other.yaml", "--output", "poses.jsonl"}), 0) << run.output();
    EXPECT_EQ(lines_of(run, "poses.jsonl").size(), 10u);
    EXPECT_EQ(lines_of(run, "poses.jsonl")[3]["targets"], lines_of(run, "recorded/poses.jsonl")[3]["targets"]);
}

TEST(Sessions, H264RecordsAllFramesAndPosesClosely) {
    ArhostRun run(recording("lockstep", "10", "", "codec: h264"));
    ASSERT_EQ(run.run(), 0) << run.output();
    ASSERT_EQ(run.run(replaying()), 0) << run.output();
    const auto recorded = lines_of(run, "recorded/poses.jsonl"), replayed = lines_of(run, "replayed/poses.jsonl");
    ASSERT_EQ(replayed.size(), 10u);
    for (std::size_t i = 0; i < 10; ++i) {
        ASSERT_EQ(replayed[i]["targets"].size(), recorded[i]["targets"].size()) << i;
        for (std::size_t axis = 12; axis < 15 && !recorded[i]["targets"].empty(); ++axis)
            EXPECT_NEAR(replayed[i]["targets"][0]["mt"][axis].get<double>(),
                        recorded[i]["targets"][0]["mt"][axis].get<double>(), 1)
                << i;
    }
    EXPECT_EQ(recorded[0]["targets"].size(), 1u);
}

TEST(Sessions, AKilledHostLosesNoFrameThatWasLogged) {
    ArhostRun run(recording("live", "0"));
    run.start();
    wait_for_frames(run, 30);
    const std::size_t logged = lines_of(run, "take/frames.jsonl").size();
    const std::vector<pid_t> workers = run.workers();
    send_signal(run.pid(), SIGKILL);
    EXPECT_EQ(run.wait(), 128 + SIGKILL);
    EXPECT_TRUE(eventually([&] { return std::ranges::none_of(workers, is_alive); }));
    ASSERT_EQ(run.run(replaying()), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("take: the recording was interrupted; it ends after frame "));
    const auto replayed = lines_of(run, "replayed/poses.jsonl");
    EXPECT_GE(replayed.size(), logged);
    EXPECT_EQ(replayed.size(), lines_of(run, "take/frames.jsonl").size());
}

TEST(Sessions, AKilledSinkContinuesTheSession) {
    ArhostRun run(recording("live", "200"));
    run.start();
    for (const std::size_t lines : {10, 25}) {
        wait_for_frames(run, lines);
        send_signal(run.worker("sink_session"), SIGKILL);
    }
    ASSERT_EQ(run.wait(), 0) << run.output();
    ASSERT_EQ(run.run(replaying()), 0) << run.output();
    EXPECT_EQ(run.messages().find("interrupted"), std::string::npos) << run.messages();
    const auto recorded = files_in(run, "recorded"), replayed = files_in(run, "replayed");
    EXPECT_GT(replayed.size(), 20u);
    for (const auto &[name, bytes] : replayed) // in mode live, an output that restarts may miss frames
        if (name.ends_with(".png") && recorded.contains(name)) {
            EXPECT_TRUE(bytes == recorded.at(name)) << name;
        }
}

TEST(Sessions, AReplayWarnsOfAnotherPluginWithTheRecordedShortName) {
    ArhostRun run(recording("lockstep", "2"));
    ASSERT_EQ(run.run(), 0) << run.output();
    Json description = Json::parse(run.read("take/session.json"));
    Json &recorded = description["plugins"]["raytracer"];
    EXPECT_EQ(recorded["id"], "org.arhost.rt_embree");
    EXPECT_EQ(description["plugins"]["source"]["id"], "org.arhost.source_synthetic");
    const std::string warning = "the session was recorded with 'org.example.rt_embree', but this plugin is "
                                "'org.arhost.rt_embree'; its results may differ";
    recorded["id"] = "org.example.rt_embree";
    run.write("take/session.json", description.dump());
    run.expect(replaying(), 0, {warning});
    recorded["id"] = "org.example.rt_other"; // the configuration chooses the plugin, by its short name
    run.write("take/session.json", description.dump());
    run.expect(replaying(), 0, {});
    EXPECT_THAT(run.output(), Not(HasSubstr("the session was recorded with")));
    recorded.erase("id"); // as in sessions of earlier drafts
    run.write("take/session.json", description.dump());
    run.expect(replaying(), 0, {});
    EXPECT_THAT(run.output(), Not(HasSubstr("the session was recorded with")));
}

TEST(Sessions, AnEditedSessionGainsNoPermission) {
    ArhostRun run(recording("lockstep", "2"));
    ASSERT_EQ(run.run(), 0) << run.output();
    const std::string configuration = run.read("take/configuration.yaml");
    run.write("take/configuration.yaml", configuration + "sandbox: none\nplugin_path: [.]\n");
    ASSERT_EQ(run.run(replaying({"-v"})), 0) << run.output();
    EXPECT_THAT(run.output(), Not(HasSubstr("sandbox: none")));
    run.write("take/configuration.yaml", configuration + "sandbox: none\nsandbox: none\n");
    EXPECT_EQ(run.run(replaying({"-v"})), 0) << run.output();
    EXPECT_THAT(run.output(), Not(HasSubstr("sandbox: none"))) << "the key is given twice";
    run.write("take/configuration.yaml", configuration);
    const std::string description = run.read("take/session.json");
    for (const char *path : {"sandbox", "tracker.plugin", "source.plugin", "stats", "tracker.options.a.b",
                             "alternatives.tracker[0].plugin", "tracker", "outputs[0].path"}) {
        nlohmann::json edited = nlohmann::json::parse(description);
        edited["changed_options"][path] = "none";
        run.write("take/session.json", edited.dump());
        EXPECT_EQ(run.run(replaying()), 2) << path;
        EXPECT_THAT(run.output(), HasSubstr("is not an option of the tracker or ray tracer")) << path;
    }
    run.write("take/session.json", description);
    std::string other = configuration;
    other.replace(other.find("tracker_aruco"), std::string("tracker_aruco").size(), "./tracker_aruco.so");
    run.write("take/configuration.yaml", other);
    run.expect(replaying(), 2, {"tracker.plugin: is a file, which a session cannot choose"});
    // A script in the session's folder is code, too.
    run.write("take/code.py", "import os\n");
    const std::string script = run.path("take/code.py").string();
    other = configuration;
    other.replace(other.find("rt_embree"), 9, "rt_python, allow: [network, processes]");
    other.replace(other.find("options: {}, deadline"), 11, "options: {script: " + script + "}");
    run.write("take/configuration.yaml", other);
    run.expect(replaying(), 2,
               {"the permission 'network' for raytracer, the permission 'processes' for raytracer",
                "the code '" + script + "' (raytracer.options.script)"});
}

TEST(Sessions, AFullDiskKeepsTheFramesBefore) {
    ArhostRun run(recording("lockstep", "40"));
    std::filesystem::create_directories(run.path("full"));
    constexpr int no_mount = 99;
    run.start({"--config", "run.yaml", "--set", "outputs[0].path=full/take"}, [] {
        if (::unshare(CLONE_NEWNS) != 0 || ::mount("", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
            ::mount("none", "full", "tmpfs", 0, "size=1m") != 0)
            ::_exit(no_mount);
        const pid_t arhost = ::fork();
        if (arhost == 0)
            return;
        int status = 0;
        ::waitpid(arhost, &status, 0);
        std::filesystem::copy("full/take", "take");
        ::_exit(WEXITSTATUS(status));
    });
    const int status = run.wait();
    if (status == no_mount)
        GTEST_SKIP() << "this user may not mount a tmpfs";
    EXPECT_EQ(status, 1);
    EXPECT_THAT(run.output(), HasSubstr("No space left on device (free some space, or choose another path)"));
    EXPECT_TRUE(run.exists("recorded/0039.png")) << "other outputs continue";
    ASSERT_EQ(run.run(replaying()), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("interrupted"));
    const auto recorded = files_in(run, "recorded"), replayed = files_in(run, "replayed");
    EXPECT_GT(replayed.size(), 5u);
    EXPECT_LT(replayed.size(), 41u);
    for (const auto &[name, bytes] : replayed)
        if (name.ends_with(".png")) {
            EXPECT_TRUE(bytes == recorded.at(name)) << name;
        }
}

TEST(Sessions, TheCommandRecordStartsAndStopsThem) {
    ArhostRun run(recording("live", "0", "", "",
                            "- {plugin: sink_control, allow: [listen], control: [record, swap, set, quit]}\n"
                            "record: {plugin: sink_session, path: \"out/take-%02d\"}\n"
                            "alternatives: {raytracer: [{name: fine, plugin: rt_embree, options: {samples: 2}}]}\n"));
    const auto prepare = [&run] { ::setenv("XDG_RUNTIME_DIR", run.path("runtime").c_str(), 1); };
    std::filesystem::create_directories(run.path("runtime"));
    run.start({"--config", "run.yaml", "--set", "outputs[0]={plugin: sink_null}"}, prepare);
    const auto command = [&](const std::string &text) {
        const std::string line = "XDG_RUNTIME_DIR='" + run.path("runtime").string() + "' " +
                                 arhost::test::build_directory() + "/bin/arhost ctl " + text + " >>'" +
                                 run.path("ctl.txt").string() + "' 2>&1";
        return std::system(line.c_str());
    };
    ASSERT_TRUE(run.eventually([&] { return command("record on") == 0; })) << run.output();
    wait_for_frames(run, 10, "out/take-01");
    EXPECT_EQ(command("record off"), 0) << run.read("ctl.txt");
    EXPECT_EQ(command("swap raytracer fine"), 0) << run.read("ctl.txt");
    EXPECT_EQ(command("set raytracer samples 3"), 0) << run.read("ctl.txt");
    EXPECT_EQ(command("record on"), 0) << run.read("ctl.txt");
    wait_for_frames(run, 10, "out/take-02");
    EXPECT_EQ(command("quit"), 0) << run.read("ctl.txt");
    ASSERT_EQ(run.wait(), 0) << run.output();
    const auto recorded = files_in(run, "recorded");
    for (const std::string take : {"out/take-01", "out/take-02"}) {
        std::filesystem::remove_all(run.path("replayed"));
        auto arguments = replaying();
        arguments[1] = take;
        ASSERT_EQ(run.run(arguments), 0) << run.output();
        EXPECT_EQ(run.messages().find("warning"), std::string::npos) << run.messages();
        const auto replayed = files_in(run, "replayed");
        EXPECT_GE(replayed.size(), 11u);
        for (const auto &[name, bytes] : replayed) // in mode live, outputs may miss different frames
            if (name.ends_with(".png") && recorded.contains(name)) {
                EXPECT_TRUE(bytes == recorded.at(name)) << take << " " << name;
            }
    }
}

TEST(Sessions, AReplayWorksFromAnyFolderWithRelativePaths) {
    ArhostRun run;
    std::filesystem::copy(scenes + "optix-cs.yaml", run.path("own.yaml"));
    run.write("lab/run.yaml", recording("lockstep", "5"));
    ASSERT_EQ(run.run({"--config", "lab/run.yaml", "--set", "raytracer.scene=own.yaml"}), 0) << run.output();
    std::filesystem::rename(run.path("take"), run.path("lab/take"));
    auto arguments = replaying({"--allow", "."});
    arguments[1] = "lab/take";
    ASSERT_EQ(run.run(arguments), 0) << run.output();
    expect_same(run);
    // A changed scene is reported, and a missing one is an error with its position.
    std::ofstream(run.path("own.yaml"), std::ios::app) << "# changed\n";
    ASSERT_EQ(run.run(arguments), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("own.yaml' has changed since the recording; the images will differ"));
    std::filesystem::remove(run.path("own.yaml"));
    run.expect(arguments, 2, {"raytracer.scene: there is no scene file"});
}

TEST(Sessions, InvalidSessionsAndArgumentsAreReported) {
    ArhostRun run(recording("lockstep", "5"));
    run.expect({"replay", "missing"}, 2, {"missing: does not exist; name the folder of a session"});
    run.expect({"replay"}, 2, {"name the folder of a session, or a trajectory with --trajectory FILE"});
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_EQ(run.run(), 2) << "a session is not overwritten";
    EXPECT_THAT(run.output(), HasSubstr("take' exists; choose another path, or replace the session in it with "
                                        "'replace: true'"));
    EXPECT_EQ(run.run({"--config", "run.yaml", "--set", "outputs[0].options.replace=true"}), 0) << run.output();
    run.expect({"replay", "take", "--trajectory", "t.jsonl"}, 2, {"a session and --trajectory exclude each other"});
    run.expect({"replay", "take", "--with-pipeline"}, 2, {"are for trajectories; remove them"});
    run.expect({"replay", "take", "--tracker", "tracker_none"}, 2, {"--tracker: tracker.plugin: "});
    run.expect({"replay", "take", "--output", "take/frames.jsonl"}, 2, {"is a file that this run reads"});
    const std::string configuration = run.read("take/configuration.yaml");
    run.write("take/configuration.yaml",
              std::string(configuration).replace(configuration.find("rt_embree"), 9, "rt_gone"));
    EXPECT_EQ(run.run({"replay", "take"}), 2);
    EXPECT_THAT(run.output(), testing::ContainsRegex("take/configuration.yaml:5:21: raytracer.plugin: .*rt_gone"));
    run.write("take/configuration.yaml", configuration);
    const std::string log = run.read("take/frames.jsonl");
    run.write("take/frames.jsonl", std::string(log).replace(log.find('\n') + 1, 1, "("));
    run.expect({"replay", "take"}, 2, {"take/frames.jsonl:2:1: is not valid JSON; to replay the frames before it"});
}
