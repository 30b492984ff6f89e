// SPDX-License-Identifier: Apache-2.0
//
// Runs plugins under strace, to find system calls that they need but the sandbox blocks
// (core/sandbox/system_calls.cpp): a call that the allow list lacks fails with ENOSYS, one of the deny list with
// EPERM. Opening a file of /proc that the sandbox does not grant fails with EACCES.
#include "arhost_run.hpp"
#include "camera_server.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <algorithm>
#include <set>

using namespace arhost::test;
namespace fs = std::filesystem;

namespace {

// Beginnings of calls that may fail.
constexpr const char *harmless[] = {"clone3(",                // libraries then use clone
                                    "prctl(PR_CAPBSET_DROP,", // the sandbox itself, without privileges
                                    "unshare("}; // the launcher and the sandbox, on machines without namespaces

// Returns why calls cannot be traced; empty if they can be.
std::string obstacle() {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    return "under a sanitizer there is no allow list";
#else
    ArhostRun run;
    run.start({}, [] {
        ::execlp("strace", "strace", "-f", "-o", "/dev/null", "/bin/true", nullptr);
        ::_exit(127);
    });
    return run.wait() == 0 ? "" : "strace is missing or not permitted";
#endif
}

// Runs `arhost ARGUMENTS`, which must succeed, and returns the lines of its trace. `calls`: an expression of strace.
std::vector<std::string> trace_of(ArhostRun &run, const char *calls, const std::vector<std::string> &arguments) {
    run.start({}, [&] {
        ::setenv("ARHOST_PLUGIN_PATH", arhost::test::test_plugin_directory().c_str(), 1);
        const std::string arhost = arhost::test::build_directory() + "/bin/arhost";
        std::vector<const char *> argv = {"strace", "-f", "-qq", "-o", "trace.txt", "-e", calls, arhost.c_str()};
        for (const std::string &argument : arguments)
            argv.push_back(argument.c_str());
        argv.push_back(nullptr);
        ::execvp("strace", const_cast<char *const *>(argv.data()));
        ::_exit(127);
    });
    EXPECT_EQ(run.wait(), 0) << run.output();
    std::istringstream trace(run.read("trace.txt"));
    std::vector<std::string> lines;
    for (std::string line; std::getline(trace, line);)
        lines.push_back(line);
    EXPECT_FALSE(lines.empty());
    return lines;
}

// Returns the calls that failed with ENOSYS or EPERM in a run, with their arguments.
std::set<std::string> blocked_calls(ArhostRun &run, const std::vector<std::string> &arguments = {
                                                        "--config", "run.yaml", "--allow-no-target"}) {
    std::set<std::string> found;
    for (const std::string &line : trace_of(run, "status=failed", arguments))
        if (const auto has = [&](const char *text) { return line.find(text) != std::string::npos; };
            has("= -1 ENOSYS") || has("= -1 EPERM") || (has("= -1 EACCES") && has("/proc/"))) {
            const std::string call = line.substr(line.find_first_not_of("0123456789 "));
            if (std::ranges::none_of(harmless, [&](const char *beginning) { return call.starts_with(beginning); }))
                found.insert(call);
        }
    return found;
}

// Creates my_tracker with `arhost new-plugin`.
void make_tracker(ArhostRun &run, const std::string &language) {
    ASSERT_EQ(run.run({"new-plugin", "tracker", "my_tracker", "--language", language}), 0) << run.output();
}

// Returns whether a shell command succeeds in the scratch folder.
bool succeeds(ArhostRun &run, const char *command) {
    run.start({}, [command] {
        ::execlp("sh", "sh", "-c", command, nullptr);
        ::_exit(127);
    });
    return run.wait() == 0;
}

std::string pipeline_with(const std::string &tracker) {
    return "version: 1\nframes: 3\nsource: {plugin: source_synthetic}\ntracker: {" + tracker +
           ", targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\noutputs: [{plugin: sink_null}]\n";
}

struct Case {
    const char *name, *yaml;
};

} // namespace

class AllowList : public testing::TestWithParam<Case> {};

#define REQUIRE_TRACE()                                                                                              \
    if (const std::string reason = obstacle(); !reason.empty())                                                      \
    GTEST_SKIP() << reason

TEST_P(AllowList, ContainsTheCallsOf) {
    REQUIRE_TRACE();
    ArhostRun run(std::string("version: 1\nframes: 3\n") + GetParam().yaml);
    run.write("scene.yaml", small_scene);
    run.write("video.yaml", "version: 1\nframes: 3\nsource: {plugin: source_synthetic}\n"
                            "outputs: [{plugin: sink_video, path: in/video.mp4}]\n");
    if (std::string(GetParam().yaml).find("in/video.mp4") != std::string::npos) {
        run.start({"--config", "video.yaml"});
        ASSERT_EQ(run.wait(), 0) << run.output();
    }
    EXPECT_THAT(blocked_calls(run), testing::IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(
    Plugins, AllowList,
    testing::Values(Case{"SyntheticArucoEmbreeVideo",
                         "source: {plugin: source_synthetic}\n"
                         "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n"
                         "raytracer: {plugin: rt_embree, scene: scene.yaml}\n"
                         "outputs: [{plugin: sink_video, path: out/video.mkv}, "
                         "{plugin: sink_poses, path: out/poses.jsonl}, {plugin: sink_null}]\n"},
                    Case{
                        "FileAprilTagImages",
                        "source: {plugin: source_file, path: in/video.mp4}\n"
                        "camera: {width: 1280, height: 720, fx: 900}\n"
                        "tracker: {plugin: tracker_apriltag, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n"
                        "outputs: [{plugin: sink_images, path: out/frame-%04d.png}, "
                        "{plugin: sink_trajectory, path: out/path.txt}]\n"}),
    [](const auto &info) { return info.param.name; });

// Records a session.
class ReplayUnderTrace : public testing::Test {
protected:
    void SetUp() override {
        REQUIRE_TRACE();
        ASSERT_EQ(run_.run(), 0) << run_.output();
    }
    ArhostRun run_{"version: 1\nframes: 3\nsource: {plugin: source_synthetic, options: {width: 160, height: 120}}\n"
                   "outputs: [{plugin: sink_session, path: take}]\n"};
};

TEST_F(ReplayUnderTrace, MakesOnlyAllowedCalls) {
    EXPECT_THAT(blocked_calls(run_, {"replay", "take"}), testing::IsEmpty());
}

TEST_F(ReplayUnderTrace, OnlyASandboxedWorkerOpensTheLog) {
    std::set<std::string> sandboxed; // processes with a list of allowed system calls
    int opened = 0;
    for (const std::string &line : trace_of(run_, "open,openat,openat2,seccomp", {"replay", "take"})) {
        const std::string process = line.substr(0, line.find(' '));
        const auto has = [&](const char *text) { return line.find(text) != std::string::npos; };
        if (has("seccomp(SECCOMP_SET_MODE_FILTER"))
            sandboxed.insert(process);
        if (!has("frames.jsonl\"") || has("O_PATH") || has("O_CREAT")) // the sandbox opens or creates the path
            continue;
        ++opened;
        EXPECT_TRUE(sandboxed.contains(process)) << line;
    }
    EXPECT_EQ(opened, 1);
}

TEST(AllowListOfOthers, ContainsTheCallsOfPython) {
    REQUIRE_TRACE();
    ArhostRun run(pipeline_with("plugin: tracker_python, options: {script: my_tracker/my_tracker.py}"));
    if (!succeeds(run, "/usr/bin/python3 -c 'import numpy'"))
        GTEST_SKIP() << "python3-numpy is not installed";
    make_tracker(run, "python");
    EXPECT_THAT(blocked_calls(run), testing::IsEmpty());
}

// libffi generates the code of each callback.
TEST(AllowListOfOthers, ACallbackOfPythonNeedsJit) {
    for (const bool is_allowed : {false, true}) {
        ArhostRun run(pipeline_with(std::string("plugin: tracker_python, ") + (is_allowed ? "allow: [jit], " : "") +
                                    "options: {script: script.py}") +
                      "restart: {quarantine_after: 1}\n");
        if (!succeeds(run, "/usr/bin/python3 -c 'import numpy'"))
            GTEST_SKIP() << "python3-numpy is not installed";
        run.write("script.py", R"(import ctypes
class Tracker:
    def __init__(self, host):
        self.callback = ctypes.CFUNCTYPE(ctypes.c_int)(lambda: 1)
        assert self.callback() == 1
    def start(self, setup):
        pass
    def track(self, frame):
        return []
)");
        EXPECT_EQ(run.run({"--config", "run.yaml", "--allow-no-target"}), is_allowed ? 0 : 1) << run.output();
    }
}

TEST(AllowListOfOthers, ContainsTheCallsOfRust) {
    REQUIRE_TRACE();
    ArhostRun run(pipeline_with("plugin: ./my_tracker/target/debug/libmy_tracker.so"));
    if (!succeeds(run, "cargo --version"))
        GTEST_SKIP() << "cargo is not installed";
    make_tracker(run, "rust");
    ASSERT_TRUE(succeeds(run, "cd my_tracker && CARGO_TARGET_DIR=target cargo build --offline")) << run.output();
    EXPECT_THAT(blocked_calls(run), testing::IsEmpty());
}

TEST(AllowListOfOthers, ContainsTheCallsOfTheNetwork) {
    REQUIRE_TRACE();
    ArhostRun run(pipeline_with("plugin: tracker_python, allow: [network], options: {script: script.py}"));
    if (!succeeds(run, "/usr/bin/python3 -c 'import numpy'"))
        GTEST_SKIP() << "python3-numpy is not installed";
    run.write("script.py", R"(import socket, threading
class Tracker:
    def __init__(self, host):
        listener = socket.create_server(("127.0.0.1", 0))
        def serve():
            connection, _ = listener.accept()
            connection.sendall(b"1")
        threading.Thread(target=serve).start()
        with socket.create_connection(("localhost", listener.getsockname()[1])) as client:
            assert client.recv(1) == b"1"
    def start(self, setup):
        pass
    def track(self, frame):
        return []
)");
    EXPECT_THAT(blocked_calls(run), testing::IsEmpty());
}

TEST(AllowListOfOthers, ContainsTheCallsOfANetworkStream) {
    REQUIRE_TRACE();
    ARHOST_REQUIRE_RTSP_SERVER();
    const Media media;
    const CameraServer rtsp("rtsp", media), https("https", media);
    for (const std::string &stream :
         {"url: \"" + rtsp.url("h264") + "\"", "transport: udp, url: \"" + rtsp.url("h264") + "\"",
          "tls_verify: false, url: \"" + https.url("vod.m3u8") + "\""}) {
        ArhostRun run("version: 1\nframes: 3\noutputs: [{plugin: sink_null}]\nsource: {plugin: source_network, "
                      "allow: [network], options: {" +
                      stream + "}}\n");
        std::set<std::string> blocked = blocked_calls(run);
        // libavformat then uses buffers of the default size.
        std::erase_if(blocked, [](const std::string &call) { return call.find("SO_RCVBUF") != std::string::npos; });
        EXPECT_THAT(blocked, testing::IsEmpty()) << stream;
    }
}

// CMakeLists.txt runs this test in a virtual machine, which has a virtual camera.
TEST(AllowListOfOthers, ContainsTheCallsOfACamera) {
    REQUIRE_TRACE();
    if (!fs::exists("/dev/video0"))
        GTEST_SKIP() << "there is no camera";
    ArhostRun run(
        "version: 1\nframes: 3\noutputs: [{plugin: sink_null}]\nsource: {plugin: source_v4l2, allow: [video], "
        "deadline_ms: 60000, start_deadline_ms: 60000, options: {device: /dev/video0}}\n");
    EXPECT_THAT(blocked_calls(run), testing::IsEmpty());
}
