// SPDX-License-Identifier: Apache-2.0
//
// Runs arhost's own plugins under strace, to find system calls that they need but the sandbox's allow list lacks
// (core/sandbox/system_calls.cpp). Such a call fails with ENOSYS.
#include "arhost_run.hpp"

#include <gmock/gmock.h>

#include <set>

using namespace arhost::test;
namespace fs = std::filesystem;

namespace {

// Calls that fail on purpose, because libraries then use an older call.
const std::set<std::string> expected = {"clone3"};

bool can_trace() {
    ArhostRun run;
    run.start({}, [] {
        ::execlp("strace", "strace", "-f", "-o", "/dev/null", "/bin/true", nullptr);
        ::_exit(127);
    });
    return run.wait() == 0;
}

// Returns the calls that failed with ENOSYS in a run of `yaml`.
std::set<std::string> missing_calls(ArhostRun &run) {
    run.start({}, [] {
        ::setenv("ARHOST_PLUGIN_PATH", ARHOST_TEST_PLUGIN_DIRECTORY, 1);
        ::execlp("strace", "strace", "-f", "-qq", "-o", "trace.txt", "-e", "status=failed",
                 ARHOST_BINARY_DIRECTORY "/bin/arhost", "--config", "run.yaml", nullptr);
        ::_exit(127);
    });
    EXPECT_EQ(run.wait(std::chrono::seconds(100)), 0) << run.output();
    std::istringstream trace(run.read("trace.txt"));
    std::set<std::string> found;
    for (std::string line; std::getline(trace, line);)
        if (line.find("= -1 ENOSYS") != std::string::npos) {
            const std::size_t begin = line.find_first_not_of("0123456789 "), end = line.find('(', begin);
            const std::string call = line.substr(begin, end - begin);
            if (!expected.contains(call))
                found.insert(call);
        }
    EXPECT_TRUE(fs::file_size(run.path("trace.txt")) > 0);
    return found;
}

struct Case {
    const char *name, *yaml;
};

} // namespace

class AllowList : public testing::TestWithParam<Case> {};

TEST_P(AllowList, ContainsTheCallsOf) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "under a sanitizer there is no allow list";
#endif
    if (!can_trace())
        GTEST_SKIP() << "strace is missing or not permitted";
    ArhostRun run(std::string("version: 1\nframes: 3\n") + GetParam().yaml);
    run.write("scene.yaml", small_scene);
    run.write("video.yaml", "version: 1\nframes: 3\nsource: {plugin: source_synthetic}\n"
                            "outputs: [{plugin: sink_video, path: in/video.mp4}]\n");
    if (std::string(GetParam().yaml).find("in/video.mp4") != std::string::npos) {
        run.start({"--config", "video.yaml"});
        ASSERT_EQ(run.wait(), 0) << run.output();
    }
    EXPECT_THAT(missing_calls(run), testing::IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(Plugins, AllowList,
                         testing::Values(Case{"SyntheticArucoEmbreeVideo",
                                              "source: {plugin: source_synthetic}\n"
                                              "tracker: {plugin: tracker_aruco, markers: [{id: 0, side_mm: 80}]}\n"
                                              "raytracer: {plugin: rt_embree, scene: scene.yaml}\n"
                                              "outputs: [{plugin: sink_video, path: out/video.mkv}, "
                                              "{plugin: sink_poses, path: out/poses.jsonl}, {plugin: sink_null}]\n"},
                                         Case{"FileAprilTagImages",
                                              "source: {plugin: source_file, path: in/video.mp4}\n"
                                              "camera: {width: 1280, height: 720, fx: 900}\n"
                                              "tracker: {plugin: tracker_apriltag, markers: [{id: 0, side_mm: 80}]}\n"
                                              "outputs: [{plugin: sink_images, path: out/frame-%04d.png}, "
                                              "{plugin: sink_trajectory, path: out/path.txt}]\n"}),
                         [](const auto &info) { return info.param.name; });
