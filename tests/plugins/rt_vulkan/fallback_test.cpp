// SPDX-License-Identifier: Apache-2.0
//
// Tests runs of rt_vulkan in the sandbox: each path, and a run in which the Vulkan driver disappears and the worker
// of rt_vulkan is killed. The fallback ray tracer must take over.
#include "arhost_run.hpp"
#include "copy_drivers.hpp"
#include "two_tracers.hpp"
#include "waiting.hpp"

#include <gmock/gmock.h>

#include <algorithm>

namespace arhost::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int frames = 400;

class LostDriver : public testing::Test {
protected:
    void SetUp() override {
#if defined(__SANITIZE_ADDRESS__)
        GTEST_SKIP() << "the leak checker would report leaks of Vulkan drivers, and the worker would fail";
#endif
        ARHOST_REQUIRE_VULKAN();
    }
    LostDriver() : drivers_(run_.path("drivers")), list_(copy_drivers(drivers_)) {
        run_.write("scene.yaml", small_scene);
    }
    void start(const char *more) {
        run_.write("run.yaml",
                   "version: 1\nsource: {plugin: source_counter, options: {frames: " + std::to_string(frames) +
                       ", width: 64, height: 48, delay_ms: 5}}\n"
                       "tracker: {plugin: tracker_counter, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}\n"
                       "raytracer: {plugin: rt_vulkan, scene: scene.yaml, allow: [gpu], reads: [drivers]" +
                       more + "}\noutputs: [{plugin: sink_counter, path: out/counted.txt}]\nstats: stats.json\n");
        run_.start({"--config", "run.yaml"}, [this] {
            ::setenv("VK_DRIVER_FILES", list_.c_str(), 1);
            ::setenv("VK_ICD_FILENAMES", list_.c_str(), 1);
        });
    }
    // Returns the number of frames with an overlay that the sink has received.
    std::ptrdiff_t overlaid() const {
        const auto lines =
            run_.exists("out/counted.txt") ? counted(run_, "out/counted.txt") : std::vector<CountedLine>();
        return std::ranges::count_if(lines, [](const CountedLine &line) { return line.kind != ARHOST_OVERLAY_NONE; });
    }
    void remove_drivers() {
        EXPECT_TRUE(run_.eventually([&] { return overlaid() >= 20; })) << run_.output();
        fs::remove_all(drivers_);
        ASSERT_GT(run_.worker("rt_vulkan"), 0) << run_.output();
        ::kill(run_.worker("rt_vulkan"), SIGKILL); // the host restarts the worker, as it does after a device loss
    }

    ArhostRun run_;

private:
    fs::path drivers_;
    std::string list_;
};

} // namespace

TEST_F(LostDriver, FallsBackInMidRun) {
    start(", fallback: rt_embree");
    remove_drivers();
    const int status = run_.wait();
    EXPECT_EQ(status, overlaid() < frames) << run_.output();
    EXPECT_THAT(run_.output(), HasSubstr("falling back to rt_embree"));
    const nlohmann::json stats = nlohmann::json::parse(run_.read("stats.json"));
    EXPECT_EQ(stats["frames"]["composited"], frames);
    EXPECT_GE(stats["frames"]["augmented"], frames - 5)
        << "at most 5 frames may lack an overlay while the host switches to the fallback";
    EXPECT_GE(overlaid(), frames - 5);
    const nlohmann::json &device = stats["stages"]["device"], &all = stats["stages"]["raytracer"];
    EXPECT_GE(device["count"], 20) << stats["stages"];
    EXPECT_LT(device["count"], all["count"]) << "the fallback must not report a device time";
    EXPECT_GT(device["p50_ms"], 0.0);
    EXPECT_LE(device["max_ms"], all["max_ms"]);
}

TEST_F(LostDriver, ContinuesAsPlainVideoWithoutAFallback) {
    start("");
    remove_drivers();
    EXPECT_EQ(run_.wait(), 1) << run_.output();
    EXPECT_THAT(run_.output(), HasSubstr("Vulkan"));
    const nlohmann::json stats = nlohmann::json::parse(run_.read("stats.json"));
    EXPECT_EQ(stats["frames"]["composited"], frames);
}

class SandboxedPath : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Paths, SandboxedPath, testing::Values("plain", "query", "pipeline"),
                         [](const auto &info) { return info.param; });

TEST_P(SandboxedPath, Renders) {
#if defined(__SANITIZE_ADDRESS__)
    GTEST_SKIP() << "the leak checker would report leaks of Vulkan drivers, and the worker would fail";
#endif
    ARHOST_REQUIRE_VULKAN(GetParam());
    ArhostRun run;
    run.write("scene.yaml", small_scene);
    run.write("run.yaml",
              "version: 1\nsource: {plugin: source_counter, options: {frames: 3, width: 64, height: 48}}\n"
              "tracker: {plugin: tracker_counter, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}\n"
              "raytracer: {plugin: rt_vulkan, scene: scene.yaml, allow: [gpu], options: {path: " +
                  GetParam() + "}}\noutputs: [{plugin: sink_counter, path: out/counted.txt}]\n");
    run.start({"--config", "run.yaml"});
    const int status = run.wait();
    if (run.output().find("opening the Vulkan device: Vulkan reports that this is unsupported") != std::string::npos)
        GTEST_SKIP() << "the driver refuses this path in the sandbox (limits in plugins/rt_vulkan/README.md)";
    EXPECT_EQ(status, 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("path " + GetParam() + ", "));
}

} // namespace arhost::test
