// SPDX-License-Identifier: Apache-2.0
//
// Tests how rt_vulkan and arhost handle a lost device and a lack of memory, at start and while rendering.
// failing_layer.cpp injects these failures.
#include "arhost_run.hpp"
#include "copy_drivers.hpp"
#include "drivers_leak.hpp"
#include "environment_variable.hpp"
#include "scene/scene_loader.hpp"
#include "two_tracers.hpp"

#include <dlfcn.h>
#include <gmock/gmock.h>

#include <memory>
#include <optional>

namespace arhost::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::SizeIs;

constexpr auto lost = "Vulkan reports that the device is lost (VK_ERROR_DEVICE_LOST, -4)";
constexpr auto out_of_memory =
    "Vulkan reports that the device is out of memory (VK_ERROR_OUT_OF_DEVICE_MEMORY, -2); use smaller meshes";

// Selects the failure that failing_layer.cpp injects; "" selects none.
void inject_failure(const std::string &when) {
    ::setenv("ARHOST_TEST_VULKAN_FAILS", when.c_str(), 1);
}

class LayeredTest {
protected:
    ~LayeredTest() {
        for (const char *name :
             {"ARHOST_TEST_VULKAN_FAILS", "ARHOST_TEST_VULKAN_IS_A_GPU", "VK_LAYER_PATH", "VK_INSTANCE_LAYERS"})
            ::unsetenv(name);
    }
    // Enables the layer for all Vulkan instances that are created later. Sets VK_LAYER_PATH, because older loaders do
    // not support VK_ADD_LAYER_PATH.
    static void enable_layer() {
#ifdef ARHOST_FAILING_LAYER_DIRECTORY
        ::setenv("VK_LAYER_PATH", ARHOST_FAILING_LAYER_DIRECTORY, 1);
        ::setenv("VK_INSTANCE_LAYERS", "VK_LAYER_ARHOST_failing", 1);
#endif
    }
};

// Returns the path that the plugin tries after `path` fails.
std::string path_before(const std::string &path) {
    return path == "pipeline" && no_vulkan("query").empty() ? "query" : "plain";
}

#ifdef ARHOST_FAILING_LAYER_DIRECTORY
#define ARHOST_REQUIRE_LAYER() ARHOST_REQUIRE_VULKAN()
constexpr auto layer_folder = ARHOST_FAILING_LAYER_DIRECTORY;
#else
#define ARHOST_REQUIRE_LAYER() GTEST_SKIP() << "needs the header <vulkan/vk_layer.h>, which is not installed"
constexpr auto layer_folder = "";
#endif

} // namespace

class LoadedDriver : public LayeredTest, public testing::Test {};

// The layer stands for a driver: the Vulkan loader unloads both with the instance. NVIDIA's driver fails to load
// again after some ten unloads.
TEST_F(LoadedDriver, StaysInMemory) {
    ARHOST_REQUIRE_LAYER();
    enable_layer();
    {
        PluginUnderTest plugin("rt_vulkan");
        ASSERT_EQ(plugin.create(), ARHOST_STATUS_OK) << plugin.log();
    }
    const std::string layer = std::string(layer_folder) + "/libVkLayer_arhost_failing.so";
    const std::unique_ptr<void, int (*)(void *)> loaded(dlopen(layer.c_str(), RTLD_LAZY | RTLD_NOLOAD), dlclose);
    EXPECT_TRUE(loaded) << "the layer was unloaded";
}

// ---- The plugin ------------------------------------------------------------------------------------

class FailingDevice : public LayeredTest, public testing::TestWithParam<std::string> {
protected:
    void SetUp() override {
        ARHOST_REQUIRE_LAYER();
        ARHOST_REQUIRE_VULKAN(GetParam());
        enable_layer();
        std::ofstream(folder_.path() / "scene.yaml") << small_scene;
        create();
    }
    scene::ArenaBuilder scene() const { return scene::load_scene(folder_.path() / "scene.yaml"); }
    // Creates the plugin again, with this path.
    void create() { tracer_.emplace(scene(), Options{{"path", GetParam()}}, "rt_vulkan"); }
    arhost_status start() { return tracer_->start(small_); }
    arhost_status render() {
        picture_.emplace(small_);
        return tracer_->try_render(from_the_side(small_), *picture_);
    }
    // Runs `call`, checks that it returns `status`, and returns the messages that it adds to the plugin's log.
    template <class Call> std::string log_of(arhost_status status, Call call) {
        const std::size_t before = tracer_->log().size();
        EXPECT_EQ(call(), status);
        return tracer_->log().substr(before);
    }
    // Checks that the plugin works again when no failure is injected.
    void expect_recovery() {
        inject_failure("");
        ASSERT_EQ(start(), ARHOST_STATUS_OK) << tracer_->log();
        ASSERT_EQ(render(), ARHOST_STATUS_OK) << tracer_->log();
        EXPECT_GT(picture_->alphas().rbegin()->first, 0);
    }

    const arhost_intrinsics small_ = pinhole(48, 36, 48);
    std::optional<Tracer> tracer_; // also tests destruction after a failure, which must neither hang nor crash
    std::optional<Picture> picture_;

    ScratchFolder folder_;
};
INSTANTIATE_TEST_SUITE_P(Paths, FailingDevice, testing::Values("plain", "query", "pipeline"),
                         [](const auto &info) { return info.param; });

// Some drivers report ray tracing extensions on GPUs without ray tracing hardware.
TEST_P(FailingDevice, FallsBackIfAnAnnouncedPathFails) {
    if (GetParam() == "plain")
        GTEST_SKIP() << "no path precedes the path 'plain'";
    inject_failure(GetParam() == "query" ? "device-with:VK_KHR_ray_query" : "pipelines:1");
    ::setenv("ARHOST_TEST_VULKAN_IS_A_GPU", GetParam().c_str(), 1);
    Tracer tracer(scene(), {}, "rt_vulkan");
    ::unsetenv("ARHOST_TEST_VULKAN_IS_A_GPU");
    ASSERT_EQ(tracer.start(small_), ARHOST_STATUS_OK) << tracer.log();
    const std::string next = path_before(GetParam());
    EXPECT_THAT(tracer.log(), AllOf(HasSubstr("path '" + GetParam() + "' failed, trying '" + next + "'"),
                                    HasSubstr("path " + next + ", ")));
    EXPECT_GT(tracer.render(from_the_side(small_)).alphas().rbegin()->first, 0);
    // A path that is selected by name has no fallback.
    create();
    EXPECT_THAT(log_of(ARHOST_STATUS_ERROR_UNSUPPORTED, [&] { return start(); }),
                HasSubstr("that this is unsupported"));
}

TEST_P(FailingDevice, FallsBackIfAPathDrawsWrongPictures) {
    if (GetParam() != "pipeline")
        GTEST_SKIP() << "the injected failure affects the path 'pipeline' only";
    ::setenv("ARHOST_TEST_VULKAN_IS_A_GPU", "pipeline", 1);
    const std::string next = path_before(GetParam());
    for (const char *failure : {"no-picture", ""}) {
        inject_failure(failure);
        Tracer tracer(scene(), {}, "rt_vulkan");
        ASSERT_EQ(tracer.start(small_), ARHOST_STATUS_OK) << tracer.log();
        if (*failure)
            EXPECT_THAT(tracer.log(),
                        testing::AllOf(testing::ContainsRegex("path 'pipeline' failed, trying '" + next +
                                                              "': [0-9]+ of [0-9]+ drawn pixels of a small picture "
                                                              "differ from those of the path 'plain'"),
                                       HasSubstr("path " + next + ", ")));
        else
            EXPECT_THAT(tracer.log(), HasSubstr("path pipeline, "));
    }
}

TEST_P(FailingDevice, ReportsAMissingFunction) {
    const std::string function = GetParam() == "plain"   ? "vkGetMemoryHostPointerPropertiesEXT"
                                 : GetParam() == "query" ? "vkCmdBuildAccelerationStructuresKHR"
                                                         : "vkCmdTraceRaysKHR";
    inject_failure("lacks:" + function);
    create();
    EXPECT_THAT(log_of(ARHOST_STATUS_ERROR_UNSUPPORTED, [&] { return start(); }),
                HasSubstr("the Vulkan driver lacks " + function));
    expect_recovery();
}

TEST_P(FailingDevice, ReportsLossAtStart) {
    for (const char *when : {"submit:1", "submit:4", "wait:1", "wait:4"}) {
        inject_failure(when);
        EXPECT_THAT(log_of(ARHOST_STATUS_ERROR_DEVICE_LOST, [&] { return start(); }), HasSubstr(lost)) << when;
    }
    expect_recovery();
}

TEST_P(FailingDevice, ReportsLossInMidRun) {
    for (const char *when : {"submit:1", "wait:1"}) {
        inject_failure("");
        ASSERT_EQ(start(), ARHOST_STATUS_OK) << tracer_->log();
        ASSERT_EQ(render(), ARHOST_STATUS_OK);
        inject_failure(when);
        EXPECT_THAT(log_of(ARHOST_STATUS_ERROR_DEVICE_LOST, [&] { return render(); }), HasSubstr(lost)) << when;
        EXPECT_THAT(log_of(ARHOST_STATUS_ERROR_DEVICE_LOST, [&] { return render(); }), HasSubstr(lost))
            << "the device must stay lost";
    }
    expect_recovery();
}

TEST_P(FailingDevice, ReportsProgressDuringASlowBand) {
    ASSERT_EQ(start(), ARHOST_STATUS_OK) << tracer_->log();
    const int before = tracer_->plugin().progress_reports();
    inject_failure("slow");
    EXPECT_EQ(render(), ARHOST_STATUS_OK);
    EXPECT_GE(tracer_->plugin().progress_reports() - before, 2);
}

TEST_P(FailingDevice, LossAtTheFirstImageEndsCleanly) {
    ASSERT_EQ(start(), ARHOST_STATUS_OK) << tracer_->log();
    inject_failure("wait:1");
    EXPECT_EQ(render(), ARHOST_STATUS_ERROR_DEVICE_LOST);
    tracer_.reset();
}

// start() allocates memory several times. In each round, one of these allocations and all later ones fail.
TEST_P(FailingDevice, ReportsOutOfMemoryAtStart) {
    int nth = 1;
    for (;; ++nth) {
        inject_failure("allocate:" + std::to_string(nth));
        const std::size_t before = tracer_->log().size();
        const arhost_status status = start();
        if (status == ARHOST_STATUS_OK)
            break;
        ASSERT_EQ(status, ARHOST_STATUS_ERROR_OUT_OF_MEMORY) << nth;
        EXPECT_THAT(tracer_->log().substr(before), HasSubstr(out_of_memory)) << nth;
    }
    EXPECT_GT(nth, 10);
    expect_recovery();
}

// Memory for the image is allocated when the first image is rendered.
TEST_P(FailingDevice, ReportsOutOfMemoryInMidRun) {
    ASSERT_EQ(start(), ARHOST_STATUS_OK) << tracer_->log();
    inject_failure("allocate:1");
    EXPECT_THAT(log_of(ARHOST_STATUS_ERROR_OUT_OF_MEMORY, [&] { return render(); }), HasSubstr(out_of_memory));
    inject_failure("");
    EXPECT_EQ(render(), ARHOST_STATUS_OK) << "memory is available again";
    inject_failure("allocate:1");
    EXPECT_EQ(tracer_->try_render(from_the_side(small_), *picture_), ARHOST_STATUS_OK)
        << "later images must not allocate memory";
    expect_recovery();
}

class OldDevice : public LayeredTest, public testing::Test {
protected:
    void SetUp() override {
        ARHOST_REQUIRE_LAYER();
        enable_layer();
    }

    ScratchFolder folder_;
};

TEST_F(OldDevice, IsRejectedIfSelected) {
    const EnvironmentVariable old("ARHOST_TEST_VULKAN_IS_OLD", "all");
    std::ofstream(folder_.path() / "scene.yaml") << small_scene;
    Tracer tracer(scene::load_scene(folder_.path() / "scene.yaml"), {{"device", "0"}}, "rt_vulkan");
    EXPECT_EQ(tracer.start(pinhole(48, 36, 48)), ARHOST_STATUS_ERROR_UNSUPPORTED);
    EXPECT_THAT(tracer.log(), HasSubstr("supports Vulkan 1.0 only; 1.1 is required; choose another with "
                                        "option 'device'"));
}

TEST_F(OldDevice, IsSkippedWithAReasonIfAnotherIsUsable) {
    const std::string once = copy_drivers(folder_.path() / "a"), again = copy_drivers(folder_.path() / "b");
    if (once.empty())
        GTEST_SKIP() << "found no Vulkan driver manifests on this machine";
    const EnvironmentVariable old("ARHOST_TEST_VULKAN_IS_OLD", "first"),
        drivers("VK_DRIVER_FILES", once + ":" + again), old_name("VK_ICD_FILENAMES", once + ":" + again);
    PluginUnderTest plugin("rt_vulkan");
    EXPECT_EQ(plugin.create({}), ARHOST_STATUS_OK) << plugin.log();
    EXPECT_THAT(plugin.log(), HasSubstr("' is skipped: it supports Vulkan 1.0 only; 1.1 is required"));
}

// ---- The run ---------------------------------------------------------------------------------------

class FailingRun : public LayeredTest, public testing::Test {
protected:
    static constexpr int frames = 120;
    // The 50th submission comes some tens of frames after start. Each restarted worker fails there as well.
    static constexpr auto in_mid_run = "submit:50";

    void SetUp() override {
#if defined(__SANITIZE_ADDRESS__)
        GTEST_SKIP() << "the leak checker would report leaks of Vulkan drivers, and the worker would fail";
#endif
        ARHOST_REQUIRE_LAYER();
    }
    int run(const std::string &when, const std::string &fallback, const std::string &restart) {
        run_.write("scene.yaml", small_scene);
        run_.write("run.yaml",
                   "version: 1\nsource: {plugin: source_counter, options: {frames: " + std::to_string(frames) +
                       ", width: 64, height: 48}}\n" +
                       "tracker: {plugin: tracker_counter, targets: [{marker: 3, family: tag36h11, side_mm: 80}]}\n" +
                       "raytracer: {plugin: rt_vulkan, scene: scene.yaml, allow: [gpu], reads: ['" + layer_folder +
                       "'], environment: [ARHOST_TEST_VULKAN_FAILS]" + fallback +
                       "}\noutputs: [{plugin: sink_counter, path: out/counted.txt}]\nstats: stats.json\n" + restart);
        enable_layer();
        inject_failure(when);
        run_.start();
        const int status = run_.wait();
        lines_ = counted(run_, "out/counted.txt");
        EXPECT_THAT(lines_, SizeIs(frames)) << run_.output();
        for (std::size_t i = 0; i < lines_.size(); ++i)
            EXPECT_EQ(lines_[i].sequence, i) << "frames are missing or out of order";
        return status;
    }
    int overlaid() const {
        return static_cast<int>(std::ranges::count_if(
            lines_, [](const CountedLine &line) { return line.kind == ARHOST_OVERLAY_RENDERED; }));
    }
    int restarts() const {
        return run_.stats()["restarts"]["raytracer"];
    }

    ArhostRun run_;
    std::vector<CountedLine> lines_;
    // With proven_after_frames: 1000, the frames between two failures do not reset the count of consecutive failures.
    const std::string quarantine_after_two_failures_ =
        "restart: {proven_after_frames: 1000, quarantine_after: 2, first_delay_ms: 1}\n";
};

TEST_F(FailingRun, RestartsWithoutLosingAnOverlay) {
    EXPECT_EQ(run(in_mid_run, "", ""), 0) << run_.output();
    EXPECT_THAT(run_.output(), AllOf(HasSubstr(lost), HasSubstr("device lost; ")));
    EXPECT_GE(restarts(), 2) << run_.output();
    EXPECT_EQ(overlaid(), frames);
}

TEST_F(FailingRun, FallsBackIfRestartsDoNotHelp) {
    EXPECT_EQ(run(in_mid_run, ", fallback: rt_embree", quarantine_after_two_failures_), 0) << run_.output();
    EXPECT_THAT(run_.output(), AllOf(HasSubstr(lost), HasSubstr("falling back to rt_embree")));
    EXPECT_EQ(restarts(), 2) << "one restart of rt_vulkan, and the start of the fallback";
    EXPECT_EQ(overlaid(), frames);
    const auto crashes = run_.stats()["crashes"];
    ASSERT_THAT(crashes, SizeIs(2));
    for (const auto &crash : crashes) {
        EXPECT_GT(crash["frame"], 0) << "the crash must not be at start";
        EXPECT_THAT(crash["how"].get<std::string>(), testing::StartsWith("device lost; "));
    }
}

TEST_F(FailingRun, ContinuesAsPlainVideoWithoutAFallback) {
    EXPECT_EQ(run(in_mid_run, "", quarantine_after_two_failures_), 1) << run_.output();
    EXPECT_THAT(run_.output(), AllOf(HasSubstr(lost), HasSubstr("it failed 2 times in a row")));
    EXPECT_GT(overlaid(), 0);
    EXPECT_EQ(lines_.back().kind, ARHOST_OVERLAY_NONE);
}

TEST_F(FailingRun, FallsBackIfOutOfMemory) {
    EXPECT_EQ(run("allocate:1", ", fallback: rt_embree", quarantine_after_two_failures_), 0) << run_.output();
    EXPECT_THAT(run_.output(), AllOf(HasSubstr(out_of_memory), HasSubstr("falling back to rt_embree")));
    EXPECT_EQ(overlaid(), frames);
}

} // namespace arhost::test
