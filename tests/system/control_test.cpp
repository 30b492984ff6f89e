// SPDX-License-Identifier: Apache-2.0
//
// Tests of commands that change a run (docs/control.md), sent to the socket of sink_control.
#include "arhost_run.hpp"

#include <gmock/gmock.h>

#include <cstring>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

using namespace arhost::test;
using testing::ElementsAre;
using testing::HasSubstr;
using Json = nlohmann::json;

namespace {

constexpr const char *all_commands = "[quit, freeze, snapshot, record, load_scene, swap, set, status]";

// A run with the output sink_control, and a connection to it.
class ControlledRun : public ArhostRun {
public:
    using ArhostRun::ArhostRun;
    ~ControlledRun() {
        if (socket_ >= 0)
            ::close(socket_);
    }
    ControlledRun(const ControlledRun &) = delete;
    ControlledRun &operator=(const ControlledRun &) = delete;

    std::string socket_path() const { return path("runtime/arhost/arhost.sock"); }
    // Makes this folder the runtime folder of arhost.
    std::function<void()> prepare() const {
        return [folder = path("runtime").string()] { ::setenv("XDG_RUNTIME_DIR", folder.c_str(), 1); };
    }

    // Starts arhost and returns once its first frames are composited.
    void start_and_connect() {
        for (const char *scene : {"scene.yaml", "other.yaml"})
            if (!exists(scene))
                write(scene, small_scene);
        std::filesystem::create_directories(path("runtime"));
        start({"--config", "run.yaml"}, prepare());
        connect();
        wait_for_frames(2);
    }
    bool try_connect() {
        if (socket_ >= 0)
            ::close(socket_);
        received_.clear();
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        std::strncpy(address.sun_path, socket_path().c_str(), sizeof address.sun_path - 1);
        socket_ = ::socket(AF_UNIX, SOCK_STREAM, 0);
        if (::connect(socket_, reinterpret_cast<const sockaddr *>(&address), sizeof address) == 0)
            return true;
        ::close(socket_);
        socket_ = -1;
        return false;
    }
    void connect() {
        if (!eventually([this] { return try_connect(); }))
            throw std::runtime_error("cannot connect to sink_control: " + output());
    }
    void send(const std::string &text) const {
        if (::send(socket_, text.data(), text.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(text.size()))
            throw std::runtime_error("cannot send: " + output());
    }
    Json receive() {
        while (received_.find('\n') == std::string::npos) {
            char buffer[65536];
            const ssize_t size = ::recv(socket_, buffer, sizeof buffer, 0);
            if (size <= 0)
                throw std::runtime_error("the connection was closed: " + output());
            received_.append(buffer, static_cast<std::size_t>(size));
        }
        const std::size_t end = received_.find('\n');
        const Json answer = Json::parse(received_.substr(0, end));
        received_.erase(0, end + 1);
        return answer;
    }
    Json command(const Json &command) {
        send(command.dump() + "\n");
        return receive();
    }
    // Sends a command that must succeed.
    Json succeed(const Json &text) {
        Json answer = command(text);
        EXPECT_EQ(answer["ok"], true) << text << ": " << answer;
        return answer;
    }
    std::string error_of(const Json &text) {
        const Json answer = command(text);
        EXPECT_EQ(answer["ok"], false) << text << ": " << answer;
        return answer.value("error", "");
    }
    Json status() { return succeed({{"command", "status"}})["status"]; }
    Json status_of(const std::string &component) {
        const Json current = status();
        for (const Json &each : current["components"])
            if (each["name"] == component)
                return each;
        return nullptr;
    }
    std::uint64_t composited() { return status()["frames"]["composited"]; }
    void wait_for_frames(std::uint64_t more) {
        const std::uint64_t goal = composited() + more;
        EXPECT_TRUE(eventually([&] { return composited() >= goal; })) << output();
    }
    int quit() {
        succeed({{"command", "quit"}});
        return wait();
    }

private:
    int socket_ = -1;
    std::string received_;
};

// A run without end; every frame of its plugins is numbered, so counted.txt shows which overlay each frame got.
std::string controlled(const std::string &mode, const std::string &more = "",
                       const std::string &granted = all_commands) {
    std::string yaml = counting({.mode = mode, .source = "frames: 1000000, delay_ms: 5", .more = more});
    const std::string counter = "outputs: [{plugin: sink_counter, path: counted.txt}";
    return yaml.replace(yaml.find(counter), counter.size(),
                        counter + ", {plugin: sink_control, allow: [listen], control: " + granted + "}") +
           "snapshot: {plugin: sink_images, path: out/snapshot-%02d.png}\n"
           "record: {plugin: sink_poses, path: out/take-%02d.jsonl}\n"
           "scenes: [other.yaml]\n"
           "alternatives:\n"
           "  tracker: [{name: second, plugin: tracker_counter}, {name: broken, plugin: broken_version}]\n"
           "  raytracer: [{name: second, plugin: rt_counter}, {name: broken, plugin: tracker_counter}]\n";
}

void expect_all_frames_with_their_overlays(const ArhostRun &run) {
    const auto lines = counted(run);
    ASSERT_FALSE(lines.empty());
    for (std::size_t i = 0; i < lines.size(); ++i) {
        ASSERT_EQ(lines[i].sequence, i) << "a frame is missing";
        ASSERT_EQ(lines[i].video, i);
        ASSERT_EQ(lines[i].overlay, std::to_string(i)) << "the overlay belongs to another frame";
    }
}

Json swap(const std::string &component, const std::string &plugin) {
    return {{"command", "swap"}, {"component", component}, {"plugin", plugin}};
}

// A run whose second ray tracer is rt_light.
std::string controlled_with_light() {
    std::string yaml = controlled("lockstep");
    const std::string second = "second, plugin: rt_counter";
    return yaml.replace(yaml.find(second), second.size(), "light, plugin: rt_light");
}

} // namespace

TEST(Control, StatusDescribesTheRun) {
    ControlledRun run(controlled("live"));
    run.start_and_connect();
    const Json status = run.status();
    EXPECT_THAT(run.succeed({{"command", "status"}})["granted"],
                ElementsAre("freeze", "load_scene", "quit", "record", "set", "snapshot", "status", "swap"));
    EXPECT_EQ(status["mode"], "live");
    EXPECT_EQ(status["frozen"], false);
    EXPECT_EQ(status["recording"], nullptr);
    EXPECT_EQ(status["scene"], "scene");
    EXPECT_THAT(status["scenes"], ElementsAre("scene", "other"));
    EXPECT_GT(status["fps"], 0);
    EXPECT_GT(status["stages"]["latency"]["count"], 0);
    EXPECT_EQ(status["latency"]["from"], "arrival");
    EXPECT_EQ(status["targets"][0]["name"], "tag36h11-3");
    EXPECT_EQ(status["targets"][0]["mt"].size(), 16);
    EXPECT_EQ(status["missing_target"], nullptr);
    const Json tracker = run.status_of("tracker");
    EXPECT_EQ(tracker["plugin"], "tracker_counter");
    EXPECT_EQ(tracker["state"], "running");
    EXPECT_EQ(tracker["choice"], "tracker_counter");
    EXPECT_THAT(tracker["choices"], ElementsAre("tracker_counter", "second", "broken"));
    EXPECT_EQ(run.quit(), 0) << run.output();
}

TEST(Control, FreezeStopsALockstepRunWithoutLosingFrames) {
    ControlledRun run(controlled("lockstep"));
    run.start_and_connect();
    EXPECT_EQ(run.succeed({{"command", "freeze"}})["frozen"], true);
    const auto frames_in = [&] { return run.status()["frames"]["in"].get<std::uint64_t>(); };
    constexpr std::uint64_t reads_in_progress = 2; // frames that the source may already be reading
    const std::uint64_t last = frames_in() + reads_in_progress;
    for (int answers = 0; answers < 100; ++answers)
        ASSERT_LE(frames_in(), last);
    // The frames in progress are finished, and no other follows.
    EXPECT_TRUE(run.eventually([&] {
        const Json frames = run.status()["frames"];
        return frames["in"] == frames["composited"];
    })) << run.output();
    EXPECT_LE(frames_in(), last);
    EXPECT_EQ(run.status()["frozen"], true);
    EXPECT_EQ(run.succeed({{"command", "freeze"}, {"on", false}})["frozen"], false);
    run.wait_for_frames(10);
    EXPECT_EQ(run.quit(), 0) << run.output();
    expect_all_frames_with_their_overlays(run);
}

TEST(Control, FreezeDiscardsCameraFramesInModeLive) {
    ControlledRun run(controlled("live"));
    run.start_and_connect();
    run.succeed({{"command", "freeze"}, {"on", true}});
    EXPECT_TRUE(run.eventually([&] { return run.status()["frames"]["dropped"].value("freeze", 0) >= 20; }));
    run.succeed({{"command", "freeze"}});
    run.wait_for_frames(3);
    EXPECT_EQ(run.quit(), 0) << run.output();
}

TEST(Control, ReplacesTrackerAndRayTracerWithoutLosingAFrame) {
    ControlledRun run(controlled("lockstep"));
    run.start_and_connect();
    for (int i = 0; i < 5; ++i)
        for (const char *name : {"second", "_counter"})
            for (const std::string component : {"tracker", "raytracer"}) {
                const std::string plugin =
                    *name == '_' ? (component == "tracker" ? "tracker" : "rt") + std::string(name) : name;
                EXPECT_EQ(run.succeed(swap(component, plugin))["plugin"], plugin);
                EXPECT_EQ(run.status_of(component)["choice"], plugin);
                run.wait_for_frames(1);
            }
    EXPECT_TRUE(run.eventually([&] { return run.workers().size() == 5; })) << "the replaced workers must end";
    EXPECT_EQ(run.quit(), 0) << run.output();
    expect_all_frames_with_their_overlays(run);
    const Json stats = run.stats();
    EXPECT_EQ(stats["restarts"]["tracker"], 0);
    EXPECT_EQ(stats["frames"]["tracked"], stats["frames"]["composited"]) << "no frame may count twice";
}

// The ray tracer draws how many images it has rendered before.
TEST(Control, ASwapAndANewSceneBeginWithoutTheStateOfTheRaytracer) {
    std::string yaml = controlled("lockstep");
    for (std::size_t at; (at = yaml.find("rt_counter")) != std::string::npos;)
        yaml.replace(at, std::string("rt_counter").size(), "rt_history");
    ControlledRun run(yaml);
    run.start_and_connect();
    const Json changes[] = {swap("raytracer", "second"),
                            {{"command", "load_scene"}, {"scene", "other"}},
                            swap("raytracer", "rt_history")};
    for (const Json &change : changes) {
        run.succeed(change);
        run.wait_for_frames(20); // more than pass before the new ray tracer renders
    }
    EXPECT_EQ(run.quit(), 0) << run.output();
    std::uint64_t beginnings = 0, next = 0;
    for (const CountedLine &line : counted(run)) {
        beginnings += line.overlay == "0";
        next = line.overlay == "0" ? 0 : next;
        ASSERT_EQ(line.overlay, std::to_string(next++)) << "frame " << line.sequence;
    }
    EXPECT_EQ(beginnings, 1 + std::size(changes));
}

TEST(Control, ReplacesStraightByLinearImagesAndBackWithoutLosingAFrame) {
    std::string scene = small_scene;
    ControlledRun run(controlled_with_light());
    run.write("scene.yaml", scene.replace(scene.find('1'), 1, "2"));
    run.start_and_connect();
    for (int i = 0; i < 2; ++i)
        for (const char *plugin : {"light", "rt_counter"}) {
            run.succeed(swap("raytracer", plugin));
            run.wait_for_frames(20);
        }
    ASSERT_EQ(run.quit(), 0) << run.output();
    expect_all_frames_with_their_overlays(run);
}

TEST(Control, ReplacesComponentsInModeLiveWithTheirFramesOverlays) {
    ControlledRun run(controlled("live"));
    run.start_and_connect();
    for (int i = 0; i < 3; ++i)
        for (const std::string component : {"tracker", "raytracer"}) {
            run.succeed(swap(component, "second"));
            run.succeed(swap(component, component == "tracker" ? "tracker_counter" : "rt_counter"));
        }
    EXPECT_EQ(run.quit(), 0) << run.output();
    for (const CountedLine &line : counted(run)) {
        EXPECT_EQ(line.video, line.sequence);
        EXPECT_EQ(line.overlay, std::to_string(line.sequence)) << "no frame may be shown without its overlay";
    }
}

TEST(Control, KeepsTheOldPluginIfTheNewOneDoesNotStart) {
    ControlledRun run(controlled("lockstep"));
    run.start_and_connect();
    EXPECT_THAT(run.error_of(swap("tracker", "broken")), HasSubstr("broken_version"));
    EXPECT_THAT(run.error_of(swap("raytracer", "broken")), HasSubstr("is a tracker, not a raytracer"));
    EXPECT_EQ(run.status_of("tracker")["choice"], "tracker_counter");
    run.wait_for_frames(5);
    EXPECT_EQ(run.quit(), 0) << run.output();
    expect_all_frames_with_their_overlays(run);
}

TEST(Control, RejectsSwapsOfAComponentThatTheRunLacks) {
    ControlledRun run("version: 1\nsource: {plugin: source_counter, options: {frames: 1000000, delay_ms: 5}}\n"
                      "tracker: {plugin: tracker_counter, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}\n"
                      "alternatives: {tracker: [{name: second, plugin: tracker_counter}]}\n"
                      "outputs: [{plugin: sink_counter, path: counted.txt}, "
                      "{plugin: sink_control, allow: [listen], control: [quit, swap, status]}]\n");
    run.start_and_connect();
    EXPECT_EQ(run.error_of(swap("raytracer", "second")), "there is no 'second'");
    run.succeed(swap("tracker", "second"));
    EXPECT_EQ(run.quit(), 0) << run.output();
}

TEST(Control, ReplacesAHungRayTracer) {
    ControlledRun run(controlled("live"));
    run.start_and_connect();
    send_signal(run.worker("rt_counter"), SIGSTOP);
    run.succeed(swap("raytracer", "second"));
    run.wait_for_frames(5);
    EXPECT_EQ(run.quit(), 0) << run.output();
    EXPECT_NE(counted(run).back().overlay, "none");
}

TEST(Control, LoadsAScene) {
    ControlledRun run(
        "version: 1\nsource: {plugin: source_synthetic, options: {frames: 0, id: 0, side_mm: 80, width: "
        "160, height: 120}}\n"
        "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n"
        "raytracer: {plugin: rt_embree, scene: scene.yaml}\nscenes: [other.yaml]\n"
        "outputs: [{plugin: sink_images, path: out/%06d.png}, "
        "{plugin: sink_control, allow: [listen], control: [quit, load_scene, status]}]\n");
    // The axes differ, so the camera differs, too.
    run.write("other.yaml", "version: 1\naxes: y-up\nmaterials: {m: {model: diffuse, diffuse: [0, 0.5, 0]}}\n"
                            "objects: [{sphere: {centre: [0, 20, 0], radius: 20}, material: m}]\n");
    run.start_and_connect();
    EXPECT_EQ(run.succeed({{"command", "load_scene"}, {"scene", "other"}})["scene"], "other");
    EXPECT_EQ(run.status()["scene"], "other");
    run.wait_for_frames(3);
    ASSERT_EQ(run.quit(), 0) << run.output();
    std::vector<std::filesystem::path> frames;
    for (const auto &entry : std::filesystem::directory_iterator(run.path("out")))
        frames.push_back(entry.path());
    std::ranges::sort(frames);

    ArhostRun reference("version: 1\nframes: " + std::to_string(frames.size()) +
                        "\nsource: {plugin: source_synthetic, options: {frames: 0, id: 0, side_mm: 80, width: 160, "
                        "height: 120}}\n"
                        "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n"
                        "raytracer: {plugin: rt_embree, scene: other.yaml}\n"
                        "outputs: [{plugin: sink_images, path: out/%06d.png}]\n");
    reference.write("other.yaml", run.read("other.yaml"));
    ASSERT_EQ(reference.run(), 0) << reference.output();
    EXPECT_NE(read_file(frames.front()), reference.read("out/" + frames.front().filename().string()));
    EXPECT_EQ(read_file(frames.back()), reference.read("out/" + frames.back().filename().string()));
}

TEST(Control, ASceneOfAnotherIntegratorReplacesTheFormOfImages) {
    std::string path = small_scene;
    ControlledRun run(controlled_with_light());
    run.write("other.yaml", path.replace(path.find('1'), 1, "2"));
    run.start_and_connect();
    const auto load = [](const std::string &scene) { return Json{{"command", "load_scene"}, {"scene", scene}}; };
    EXPECT_THAT(run.error_of(swap("raytracer", "light")), HasSubstr("needs linear images and video"));
    run.succeed(load("other"));
    run.succeed(swap("raytracer", "light"));
    run.wait_for_frames(20);
    EXPECT_THAT(run.error_of(load("scene")), HasSubstr("needs linear images and video"));
    run.wait_for_frames(20);
    run.succeed(swap("raytracer", "rt_counter"));
    run.succeed(load("scene"));
    run.wait_for_frames(20);
    ASSERT_EQ(run.quit(), 0) << run.output();
    expect_all_frames_with_their_overlays(run);
}

TEST(Control, KeepsTheSceneIfTheNewOneIsInvalid) {
    ControlledRun run(controlled("lockstep"));
    const std::string scene = small_scene;
    run.write("other.yaml", scene.substr(0, scene.rfind("10")) + "-1}, material: m}]\n");
    run.start_and_connect();
    EXPECT_THAT(run.error_of({{"command", "load_scene"}, {"scene", "other"}}), HasSubstr("other.yaml:4:"));
    EXPECT_EQ(run.status()["scene"], "scene");
    run.wait_for_frames(3);
    EXPECT_EQ(run.quit(), 0) << run.output();
    expect_all_frames_with_their_overlays(run);
}

TEST(Control, WritesSnapshotsToFreeNames) {
    ControlledRun run(controlled("lockstep"));
    run.write("out/snapshot-01.png", "kept");
    run.start_and_connect();
    for (const char *number : {"02", "03"}) {
        const std::string file = run.path("out/snapshot-" + std::string(number) + ".png");
        EXPECT_EQ(run.succeed({{"command", "snapshot"}})["file"], file);
        EXPECT_TRUE(read_file(file).starts_with("\x89PNG"));
    }
    EXPECT_EQ(run.read("out/snapshot-01.png"), "kept");
    const Json files = run.status()["files"];
    ASSERT_EQ(files.size(), 2u);
    EXPECT_EQ(files[1]["number"], 2);
    EXPECT_EQ(files[1]["file"], run.path("out/snapshot-03.png").string());
    EXPECT_EQ(run.quit(), 0) << run.output();
}

TEST(Control, ASnapshotOfTheOverlayIsThatOfTheNextFrame) {
    std::string configuration = controlled("lockstep");
    const std::string snapshot = "path: out/snapshot-%02d.png";
    configuration.replace(configuration.find(snapshot), snapshot.size(), snapshot + ", options: {content: overlay}");
    ControlledRun run(configuration);
    run.start_and_connect();
    for (int i = 0; i < 2; ++i) {
        const std::string file = run.succeed({{"command", "snapshot"}})["file"];
        ASSERT_TRUE(std::filesystem::exists(file)) << file;
        EXPECT_TRUE(read_file(file).starts_with("\x89PNG"));
    }
    run.succeed({{"command", "freeze"}, {"on", true}});
    EXPECT_THAT(run.error_of({{"command", "snapshot"}}), HasSubstr("end the freeze and send the command again"));
    EXPECT_EQ(run.quit(), 0) << run.output();
}

TEST(Control, RecordsFromCommandToCommand) {
    ControlledRun run(controlled("lockstep"));
    run.start_and_connect();
    EXPECT_THAT(run.error_of({{"command", "record"}, {"on", false}}), HasSubstr("there is no recording"));
    const std::string file = run.path("out/take-01.jsonl");
    EXPECT_EQ(run.succeed({{"command", "record"}})["file"], file);
    EXPECT_EQ(run.status()["recording"], file);
    EXPECT_THAT(run.error_of({{"command", "record"}, {"on", true}}), HasSubstr("already in progress"));
    run.wait_for_frames(10);
    EXPECT_EQ(run.succeed({{"command", "record"}})["file"], file);
    EXPECT_EQ(run.status()["recording"], nullptr);
    std::istringstream lines(read_file(file));
    std::size_t count = 0;
    std::uint64_t last = 0;
    for (std::string line; std::getline(lines, line);)
        if (const Json json = Json::parse(line); json.contains("frame")) {
            if (count++ > 0) {
                EXPECT_EQ(json["frame"], last + 1) << "the recording lacks a frame";
            }
            last = json["frame"];
        }
    EXPECT_GE(count, 10u);
    EXPECT_EQ(run.succeed({{"command", "record"}})["file"], run.path("out/take-02.jsonl").string());
    EXPECT_EQ(run.quit(), 0) << run.output();
    EXPECT_TRUE(run.exists("out/take-02.jsonl")) << "the end of the run completes the recording";
}

TEST(Control, ARecordingThatCannotBeWrittenIsReported) {
    std::string configuration = controlled("live");
    const std::string record = "{plugin: sink_poses, path: out/take-%02d.jsonl}";
    configuration.replace(configuration.find(record), record.size(),
                          "{plugin: sink_realtime, path: out/take-%02d.txt}");
    ControlledRun run(configuration);
    run.start_and_connect();
    const Json before = run.status()["messages"]; // about the configuration
    for (const Json &message : before)
        EXPECT_EQ(message["severity"], "warning");
    const std::string file = run.succeed({{"command", "record"}})["file"];
    constexpr int misbehave_error = 5; // MISBEHAVE_ERROR in plugins/misbehave.h
    ASSERT_EQ(::sigqueue(run.worker("sink_realtime"), SIGRTMIN, {.sival_int = misbehave_error}), 0);
    EXPECT_TRUE(run.eventually([&] { return run.status()["recording"].is_null(); }));
    EXPECT_EQ(run.error_of({{"command", "record"}, {"on", false}}),
              "the recording '" + file + "' failed: an error, as requested");
    EXPECT_EQ(run.error_of({{"command", "record"}, {"on", false}}), "there is no recording to stop");
    Json messages = run.status()["messages"];
    messages.erase(messages.begin(), messages.begin() + static_cast<std::ptrdiff_t>(before.size()));
    std::string texts;
    for (const Json &message : messages) {
        EXPECT_EQ(message["severity"], "error");
        EXPECT_EQ(message["component"], "record");
        texts += message["text"].get<std::string>() + "\n";
    }
    EXPECT_THAT(texts, testing::AllOf(HasSubstr("an error, as requested\n"), HasSubstr("cannot write frame ")));
    EXPECT_EQ(run.quit(), 1) << run.output();
}

TEST(Control, ARecordingWithoutAFrameIsNoSuccess) {
    ControlledRun run(controlled("lockstep"));
    run.start_and_connect();
    run.succeed({{"command", "freeze"}, {"on", true}});
    EXPECT_TRUE(run.eventually([&] {
        const Json frames = run.status()["frames"];
        return frames["in"] == frames["composited"];
    }));
    const std::string file = run.succeed({{"command", "record"}})["file"];
    EXPECT_EQ(run.error_of({{"command", "record"}}), "no frame arrived, so no file was written");
    EXPECT_FALSE(std::filesystem::exists(file));
    EXPECT_THAT(run.status()["files"], testing::IsEmpty());
    EXPECT_EQ(run.quit(), 0) << run.output();
}

TEST(Control, ChangesAnOptionAlsoForARestartedPlugin) {
    ControlledRun run("version: 1\nsource: {plugin: source_synthetic, options: {frames: 0, id: 0, side_mm: 80}}\n"
                      "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n"
                      "raytracer: {plugin: rt_embree, scene: scene.yaml}\n"
                      "outputs: [{plugin: sink_control, allow: [listen], control: [quit, set, status]}]\n");
    run.start_and_connect();
    const auto samples = [&] { return run.status_of("raytracer")["options"][0]["value"]; };
    EXPECT_EQ(samples(), 0);
    const Json set = {{"command", "set"}, {"component", "raytracer"}, {"option", "samples"}, {"value", 4}};
    run.succeed(set);
    EXPECT_EQ(samples(), 4);
    Json wrong = set;
    wrong["value"] = -1;
    EXPECT_THAT(run.error_of(wrong), HasSubstr("0 to 256"));
    wrong["value"] = {1};
    EXPECT_THAT(run.error_of(wrong), HasSubstr("'value' must be"));
    wrong["option"] = "threads";
    wrong["value"] = 1;
    EXPECT_THAT(run.error_of(wrong), HasSubstr("these can: samples, light_samples"));
    wrong["component"] = "nobody";
    EXPECT_THAT(run.error_of(wrong), HasSubstr("no running component 'nobody'"));
    const pid_t killed = run.worker("rt_embree");
    send_signal(killed, SIGKILL);
    EXPECT_TRUE(run.eventually([&] {
        const Json raytracer = run.status_of("raytracer");
        return raytracer["restarts"] == 1 && raytracer["state"] == "running";
    }));
    EXPECT_EQ(samples(), 4);
    EXPECT_EQ(run.quit(), 0) << run.output();
}

TEST(Control, AdaptedSamplesFollowTheOption) {
    ControlledRun run(
        "version: 1\nmode: live\nsource: {plugin: source_synthetic, fps: 10, options: {frames: 0, id: 0, "
        "side_mm: 80, width: 320, height: 240}}\n"
        "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n"
        "raytracer: {plugin: rt_embree, scene: scene.yaml, options: {samples: 2}}\n"
        "live: {target_fps: 0.1}\n"
        "outputs: [{plugin: sink_control, allow: [listen], control: [quit, set, status]}]\n");
    run.start_and_connect();
    const auto becomes = [&](int samples) {
        return run.eventually([&] {
            const Json quality = run.succeed({{"command", "status"}})["status"]["quality"];
            return quality.is_object() && quality.value("samples", 0) == samples;
        });
    };
    EXPECT_TRUE(becomes(2));
    for (const int samples : {4, 1}) {
        run.succeed({{"command", "set"}, {"component", "raytracer"}, {"option", "samples"}, {"value", samples}});
        EXPECT_TRUE(becomes(samples)) << samples;
    }
    EXPECT_EQ(run.quit(), 0) << run.output();
}

// The camera is unplugged at the third frame and does not come back.
TEST(Control, TheStatusSaysWhichCameraIsMissing) {
    ControlledRun run("version: 1\nmode: live\nrestart: {first_delay_ms: 1}\nsource: {plugin: source_waiting_live, "
                      "options: {wait_ms: 10, unplugged_at: 3}}\n"
                      "outputs: [{plugin: sink_control, allow: [listen], control: [quit, status]}]\n");
    run.start_and_connect();
    EXPECT_TRUE(run.eventually([&] { return !run.status_of("source")["missing_device"].is_null(); }));
    EXPECT_EQ(run.quit(), 0) << run.output();
}

TEST(Control, ANewSceneKeepsAChangedOption) {
    ControlledRun run("version: 1\nsource: {plugin: source_synthetic, options: {frames: 0, id: 0, side_mm: 80}}\n"
                      "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n"
                      "raytracer: {plugin: rt_embree, scene: scene.yaml}\nscenes: [other.yaml]\n"
                      "alternatives: {raytracer: [{name: second, plugin: rt_embree}]}\n"
                      "outputs: [{plugin: sink_control, allow: [listen], control: [quit, load_scene, set, status, "
                      "swap]}]\n");
    run.start_and_connect();
    const auto samples = [&] { return run.status_of("raytracer")["options"][0]["value"]; };
    run.succeed({{"command", "set"}, {"component", "raytracer"}, {"option", "samples"}, {"value", 4}});
    run.succeed({{"command", "load_scene"}, {"scene", "other"}});
    EXPECT_EQ(samples(), 4);
    run.succeed(swap("raytracer", "second"));
    EXPECT_EQ(samples(), 0);
    EXPECT_EQ(run.quit(), 0) << run.output();
}

TEST(Control, RejectsWhatTheConfigurationDoesNotGrantOrList) {
    ControlledRun run(controlled("lockstep", "", "[quit, status, load_scene, swap]"));
    run.start_and_connect();
    EXPECT_THAT(run.error_of({{"command", "freeze"}}), HasSubstr("does not grant 'freeze'"));
    EXPECT_THAT(run.error_of({{"command", "dance"}}), HasSubstr("unknown command 'dance'"));
    EXPECT_THAT(run.error_of({{"command", "load_scene"}, {"scene", "/etc/passwd"}}),
                HasSubstr("there is no '/etc/passwd'; choose one of: scene, other"));
    EXPECT_THAT(run.error_of(swap("tracker", "../evil.so")), HasSubstr("choose one of: tracker_counter, second"));
    EXPECT_THAT(run.error_of(swap("source", "second")),
                HasSubstr("choose a component and its new plugin: tracker ("));
    Json with_path = swap("tracker", "second");
    with_path["allow"] = {"network"};
    EXPECT_THAT(run.error_of(with_path), HasSubstr("unknown member 'allow'"));
    EXPECT_THAT(run.error_of({{"command", "swap"}, {"component", 3}}), HasSubstr("'component' must be a string"));
    EXPECT_THAT(run.error_of({{"command", 3}}), HasSubstr("'command' must be a string"));
    run.send("[1, 2]\n");
    EXPECT_THAT(run.receive()["error"], HasSubstr("must be a JSON object"));
    run.send("{\"command\": \n");
    EXPECT_THAT(run.receive()["error"], HasSubstr("must be a JSON object"));
    EXPECT_EQ(run.quit(), 0) << run.output();
    expect_all_frames_with_their_overlays(run);
}

TEST(Control, ListsTheChoicesIfTheNameIsMissing) {
    ControlledRun run(controlled("lockstep"));
    run.start_and_connect();
    EXPECT_EQ(run.error_of({{"command", "swap"}}),
              "choose a component and its new plugin: tracker (tracker_counter, second, broken), raytracer "
              "(rt_counter, second, broken)");
    EXPECT_EQ(run.error_of({{"command", "swap"}, {"component", "raytracer"}}),
              "choose one of: rt_counter, second, broken");
    EXPECT_EQ(run.error_of({{"command", "load_scene"}}), "choose one of: scene, other");
    EXPECT_EQ(run.error_of({{"command", "set"}, {"component", "raytracer"}}),
              "choose an option that can be changed while rt_counter runs; none of its options can");
    EXPECT_EQ(run.quit(), 0) << run.output();
}

TEST(Control, ARefusalNamesWhatIsGranted) {
    ControlledRun run(controlled("lockstep", "", "[quit, status]"));
    run.start_and_connect();
    EXPECT_THAT(run.command({{"command", "freeze"}})["granted"], ElementsAre("quit", "status"));
    EXPECT_EQ(run.quit(), 0) << run.output();
}

TEST(Control, TheStatusSaysWhichMarkerIsSeenInsteadOfTheTarget) {
    ControlledRun run(
        "version: 1\nmode: live\n"
        "source: {plugin: source_synthetic, fps: 30, options: {frames: 0, id: 5, side_mm: 80, width: 320, "
        "height: 240}}\n"
        "tracker: {plugin: tracker_aruco, targets: [{name: cup, marker: 0, family: tag36h11, side_mm: "
        "80}]}\n"
        "outputs: [{plugin: sink_control, allow: [listen], control: [quit, status]}]\n");
    run.start_and_connect();
    EXPECT_TRUE(run.eventually([&] { return run.status()["missing_target"].is_string(); }));
    EXPECT_THAT(
        run.status()["missing_target"].get<std::string>(),
        HasSubstr("the tracker has seen no target yet; it looks for 'cup' (tag36h11 0); it saw tag36h11 5 ("));
    EXPECT_EQ(run.quit(), 1) << "no target was seen";
}

TEST(Control, AnswersCommandsSentAtOnceInTheirOrder) {
    ControlledRun run(controlled("lockstep"));
    run.start_and_connect();
    std::string many;
    for (int i = 0; i < 100; ++i)
        many += R"({"command":"freeze","on":)" + std::string(i % 2 ? "true" : "false") + "}\n";
    run.send(many);
    for (int i = 0; i < 100; ++i)
        ASSERT_EQ(run.receive()["frozen"], i % 2 == 1);
    run.succeed({{"command", "freeze"}, {"on", false}});
    EXPECT_EQ(run.quit(), 0) << run.output();
}

TEST(Control, DisconnectsAClientThatSendsAnEndlessLine) {
    ControlledRun run(controlled("lockstep"));
    run.start_and_connect();
    const std::string part(4096, 'x');
    EXPECT_THROW(for (;;) run.send(part), std::runtime_error);
    run.connect();
    EXPECT_EQ(run.quit(), 0) << run.output();
}

TEST(Control, TheSocketIsPrivateAndSurvivesARestartOfItsWorker) {
    ControlledRun run(controlled("live"));
    run.start_and_connect();
    struct stat status {};
    ASSERT_EQ(::stat(run.socket_path().c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777, 0600u);
    ASSERT_EQ(::stat(run.path("runtime/arhost").c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777, 0700u);
    const pid_t first = run.worker("sink_control");
    send_signal(first, SIGKILL);
    EXPECT_THROW(run.status(), std::runtime_error) << "the connection ends with the worker";
    run.connect(); // waits in the queue of the socket, which the host keeps open
    EXPECT_EQ(run.status_of("sink_control")["restarts"], 1);
    EXPECT_EQ(run.quit(), 0) << run.output();
    EXPECT_FALSE(std::filesystem::exists(run.socket_path()));
}

TEST(Control, ASecondRunWithTheSameNameIsRejected) {
    ControlledRun run(controlled("live"));
    run.start_and_connect();
    ArhostRun second(
        "version: 1\nsource: {plugin: source_counter}\noutputs: [{plugin: sink_control, allow: [listen]}]\n");
    second.start({"--config", "run.yaml"}, run.prepare());
    EXPECT_EQ(second.wait(), 2);
    EXPECT_THAT(second.messages(), HasSubstr("another run uses it; choose another name"));
    EXPECT_EQ(run.quit(), 0) << run.output();
}

TEST(Control, ReplacesTheSocketFileOfAKilledRun) {
    ControlledRun run(controlled("live"));
    run.start_and_connect();
    send_signal(run.pid(), SIGKILL);
    run.wait();
    EXPECT_TRUE(std::filesystem::exists(run.socket_path()));
    EXPECT_TRUE(eventually([&] { return !run.try_connect(); })) << "the launcher ends the worker";
    run.start_and_connect();
    EXPECT_EQ(run.quit(), 0) << run.output();
}

TEST(Control, AnOutputWithASocketNeedsPermission) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter}\noutputs: [{plugin: sink_control}]\n");
    EXPECT_EQ(run.run(), 2);
    EXPECT_THAT(run.messages(),
                HasSubstr("run.yaml:3:20: outputs[0].plugin: 'sink_control' needs 'listen', which the "
                          "sandbox blocks: add 'allow: [listen]' to outputs[0]"));
}

struct BadChoice {
    const char *name, *yaml, *message;
};
class ControlConfiguration : public testing::TestWithParam<BadChoice> {};

TEST_P(ControlConfiguration, IsRejectedWithPositionAndFix) {
    ArhostRun run("version: 1\nsource: {plugin: source_counter}\n" + std::string(GetParam().yaml));
    run.write("scene.yaml", small_scene);
    EXPECT_EQ(run.run(), 2);
    EXPECT_THAT(run.messages(), HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Bad, ControlConfiguration,
    testing::Values(
        BadChoice{"SwapWithoutAlternatives", "outputs: [{plugin: sink_null, control: [swap]}]\n",
                  "run.yaml:3:41: outputs[0].control[0]: 'swap' needs the key 'alternatives'"},
        BadChoice{"ScenesWithoutRayTracer", "scenes: [demo]\n", "run.yaml:3:9: scenes: there is no 'raytracer'"},
        BadChoice{"AlternativesWithoutTracker", "alternatives: {tracker: [{plugin: tracker_aruco}]}\n",
                  "alternatives.tracker: there is no 'tracker' to which these are alternatives"},
        BadChoice{"SameNameTwice",
                  "tracker: {plugin: tracker_counter, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}\n"
                  "alternatives: {tracker: [{plugin: tracker_counter}]}\n",
                  "alternatives.tracker[0]: there are two with the name 'tracker_counter'; give each its own 'name'"},
        BadChoice{"MissingScene",
                  "tracker: {plugin: tracker_counter, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}\n"
                  "raytracer: {plugin: rt_counter, scene: scene.yaml}\nscenes: [missing.yaml]\n",
                  "run.yaml:5:10: scenes[0]: there is no scene file"},
        BadChoice{"RecordingOverAnInput", "record: {plugin: sink_poses, path: run.yaml}\n",
                  "run.yaml:3:36: record.path: 'run.yaml' is a file that this run reads; choose another path"},
        BadChoice{"BadAddress", "outputs: [{plugin: sink_control, allow: [listen], options: {listen: 'a b'}}]\n",
                  "outputs[0].options.listen: must be a name, the absolute path of a Unix socket, or ADDRESS:PORT"}),
    [](const auto &info) { return info.param.name; });

TEST(Control, CheckCoversAlternativesAndOutputsOfCommands) {
    const std::string base =
        "version: 1\nsource: {plugin: source_counter}\n"
        "tracker: {plugin: tracker_counter, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}\n";
    for (const auto &[yaml, message] :
         {std::pair<std::string, const char *>{"alternatives: {tracker: [{name: a, plugin: rt_counter}]}\n",
                                               "'rt_counter' is a raytracer, not a tracker"},
          {"record: {plugin: sink_counter, path: r-%d.txt, options: {hang_in_stop: 7}}\n",
           "record.options.hang_in_stop: must be true or false"}}) {
        ArhostRun run(base + yaml);
        EXPECT_EQ(run.run({"check", "run.yaml"}), 2);
        EXPECT_THAT(run.messages(), HasSubstr(message));
    }
}

TEST(Ctl, SendsCommandsAndPrintsTheirAnswers) {
    ControlledRun run(controlled("live"));
    run.start_and_connect();
    const auto ctl = [&](std::vector<std::string> arguments, int status) {
        arguments.insert(arguments.begin(), "ctl");
        ArhostRun client;
        client.start(std::move(arguments), run.prepare());
        EXPECT_EQ(client.wait(), status);
        return client.output();
    };
    EXPECT_EQ(ctl({"freeze", "on"}, 0), "frozen: true\n");
    EXPECT_EQ(ctl({"freeze"}, 0), "frozen: false\n");
    EXPECT_EQ(ctl({"--json", "freeze"}, 0), "{\"ok\":true,\"frozen\":true}\n");
    EXPECT_EQ(Json::parse(ctl({"--json", "status"}, 0))["status"]["frozen"], true);
    EXPECT_THAT(
        ctl({"status"}, 0),
        testing::MatchesRegex(
            "arhost [0-9.]+, mode live, scene scene, frozen\n[0-9.]+ fps, latency p50 [0-9.]+ ms, p95 [0-9.]+ ms, "
            "p99 "
            "[0-9.]+ ms, from arrival\n[0-9]+ frames: [0-9]+ with a target, [0-9]+ with an overlay(, dropped: .*)?\n"
            "target tag36h11-3: detected, distance [0-9]+ mm, reprojection error [0-9.]+ px\n"
            "source: source_counter [0-9.]+, running\ntracker: tracker_counter [0-9.]+, running\n"
            "raytracer: rt_counter [0-9.]+, running\nsink_counter: sink_counter [0-9.]+, running\n"
            "sink_control: sink_control [0-9.]+, running\n[-0-9T:.]+Z warning: arhost: run.yaml:6:40: .*\n"));
    EXPECT_EQ(ctl({"freeze", "maybe"}, 2), "error: 'freeze' takes 'on' or 'off'; without one, it toggles\n");
    EXPECT_EQ(ctl({"quit", "now"}, 2), "error: 'quit' takes at most 0 values\n");
    EXPECT_EQ(ctl({"swap", "raytracer"}, 1), "error: choose one of: rt_counter, second, broken\n");
    EXPECT_EQ(ctl({"swap", "tracker", "nothing"}, 1),
              "error: there is no 'nothing'; choose one of: tracker_counter, second, broken\n");
    EXPECT_THAT(ctl({"--name", "other", "status"}, 1),
                HasSubstr("error: no run with the name 'other' can be reached"));
    EXPECT_EQ(ctl({"quit"}, 0), "");
    EXPECT_EQ(run.wait(), 0) << run.output();
}
