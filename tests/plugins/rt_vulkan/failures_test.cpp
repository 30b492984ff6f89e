// SPDX-License-Identifier: Apache-2.0
//
// A Vulkan device that is lost or has no memory left, when it starts and in mid-run, as failing_layer.cpp has it.
#include "arhost_run.hpp"
#include "copy_drivers.hpp"
#include "drivers_leak.hpp"
#include "environment_variable.hpp"
#include "scene/loader.hpp"
#include "two_tracers.hpp"

#include <gmock/gmock.h>

#include <optional>

namespace arhost::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::SizeIs;

constexpr auto lost = "Vulkan reports that the device is lost (VK_ERROR_DEVICE_LOST, -4)";
constexpr auto out_of_memory =
    "Vulkan reports that the device is out of memory (VK_ERROR_OUT_OF_DEVICE_MEMORY, -2); use smaller meshes";

// Which call fails first (failing_layer.cpp); "" none.
void let_fail(const std::string &when) {
    ::setenv("ARHOST_TEST_VULKAN_FAILS", when.c_str(), 1);
}

class LayeredTest {
protected:
    ~LayeredTest() {
        for (const char *name :
             {"ARHOST_TEST_VULKAN_FAILS", "ARHOST_TEST_VULKAN_IS_A_GPU", "VK_LAYER_PATH", "VK_INSTANCE_LAYERS"})
            ::unsetenv(name);
    }
    // Of all instances from now on. (VK_LAYER_PATH, as older loaders know no VK_ADD_LAYER_PATH.)
    static void put_layer_in() {
#ifdef ARHOST_FAILING_LAYER_DIRECTORY
        ::setenv("VK_LAYER_PATH", ARHOST_FAILING_LAYER_DIRECTORY, 1);
        ::setenv("VK_INSTANCE_LAYERS", "VK_LAYER_ARHOST_failing", 1);
#endif
    }
};

#ifdef ARHOST_FAILING_LAYER_DIRECTORY
#define ARHOST_REQUIRE_LAYER() ARHOST_REQUIRE_VULKAN()
constexpr auto layer_folder = ARHOST_FAILING_LAYER_DIRECTORY;
#else
#define ARHOST_REQUIRE_LAYER() GTEST_SKIP() << "needs <vulkan/vk_layer.h>, which is not among Vulkan's headers here"
constexpr auto layer_folder = "";
#endif

} // namespace

// ---- The plugin ------------------------------------------------------------------------------------

class FailingDevice : public LayeredTest, public testing::TestWithParam<std::string> {
protected:
    void SetUp() override {
        ARHOST_REQUIRE_LAYER();
        ARHOST_REQUIRE_VULKAN(GetParam());
        put_layer_in();
        std::ofstream(folder_.path() / "scene.yaml") << small_scene;
        tracer_.emplace(scene::load_scene(folder_.path() / "scene.yaml"), Options{{"path", GetParam()}}, "rt_vulkan");
    }
    arhost_status start() { return tracer_->start(small_); }
    arhost_status render() {
        picture_.emplace(small_);
        return tracer_->try_render(from_the_side(small_), *picture_);
    }
    // What the plugin says while `call` gives this status.
    template <class Call> std::string told(arhost_status status, Call call) {
        const std::size_t before = tracer_->plugin().log().size();
        EXPECT_EQ(call(), status);
        return tracer_->plugin().log().substr(before);
    }
    // Nothing is left of it: once the device is sound again it starts, and traces what it should.
    void expect_to_be_mended() {
        let_fail("");
        ASSERT_EQ(start(), ARHOST_STATUS_OK) << tracer_->plugin().log();
        ASSERT_EQ(render(), ARHOST_STATUS_OK) << tracer_->plugin().log();
        EXPECT_GT(picture_->alphas().rbegin()->first, 0);
    }

    const arhost_intrinsics small_ = pinhole(48, 36, 48);
    std::optional<Tracer> tracer_; // whose end, after all, neither hangs nor crashes
    std::optional<Picture> picture_;

    ScratchFolder folder_;
};
INSTANTIATE_TEST_SUITE_P(Paths, FailingDevice, testing::Values("plain", "query", "pipeline"),
                         [](const auto &info) { return info.param; });

// As drivers have been seen to do, of GPUs without units for ray tracing.
TEST_P(FailingDevice, ThatCannotWhatItAnnouncesIsTakenByThePathBefore) {
    if (GetParam() == "plain")
        GTEST_SKIP() << "there is none before it";
    let_fail(GetParam() == "query" ? "device-with:VK_KHR_ray_query" : "pipelines:1");
    ::setenv("ARHOST_TEST_VULKAN_IS_A_GPU", GetParam().c_str(), 1);
    Tracer tracer(scene::load_scene(folder_.path() / "scene.yaml"), {}, "rt_vulkan");
    ::unsetenv("ARHOST_TEST_VULKAN_IS_A_GPU");
    ASSERT_EQ(tracer.start(small_), ARHOST_STATUS_OK) << tracer.plugin().log();
    const std::string next = GetParam() == "query" ? "plain" : "query";
    EXPECT_THAT(tracer.plugin().log(), AllOf(HasSubstr("path '" + GetParam() + "' is left for '" + next + "'"),
                                             HasSubstr("path " + next + ", ")));
    EXPECT_GT(tracer.render(from_the_side(small_)).alphas().rbegin()->first, 0);
    // The one that was asked for by name is not left.
    tracer_.emplace(scene::load_scene(folder_.path() / "scene.yaml"), Options{{"path", GetParam()}}, "rt_vulkan");
    EXPECT_THAT(told(ARHOST_STATUS_ERROR_UNSUPPORTED, [&] { return start(); }), HasSubstr("that it can't"));
}

TEST_P(FailingDevice, LostAtStartIsToldOf) {
    for (const char *when : {"submit:1", "submit:4", "wait:1", "wait:4"}) {
        let_fail(when);
        EXPECT_THAT(told(ARHOST_STATUS_ERROR_DEVICE_LOST, [&] { return start(); }), HasSubstr(lost)) << when;
    }
    expect_to_be_mended();
}

TEST_P(FailingDevice, LostInMidRunIsToldOf) {
    for (const char *when : {"submit:1", "wait:1"}) {
        let_fail("");
        ASSERT_EQ(start(), ARHOST_STATUS_OK) << tracer_->plugin().log();
        ASSERT_EQ(render(), ARHOST_STATUS_OK);
        let_fail(when);
        EXPECT_THAT(told(ARHOST_STATUS_ERROR_DEVICE_LOST, [&] { return render(); }), HasSubstr(lost)) << when;
        EXPECT_THAT(told(ARHOST_STATUS_ERROR_DEVICE_LOST, [&] { return render(); }), HasSubstr(lost))
            << "and stays so";
    }
    expect_to_be_mended();
}

TEST_P(FailingDevice, LostAtTheFirstImageEndsWell) {
    ASSERT_EQ(start(), ARHOST_STATUS_OK) << tracer_->plugin().log();
    let_fail("wait:1");
    EXPECT_EQ(render(), ARHOST_STATUS_ERROR_DEVICE_LOST);
    tracer_.reset();
}

// Of whatever allocation it is, of all that are made.
TEST_P(FailingDevice, WithoutMemoryAtStartIsToldOf) {
    int nth = 1;
    for (;; ++nth) {
        let_fail("allocate:" + std::to_string(nth));
        const std::size_t before = tracer_->plugin().log().size();
        const arhost_status status = start();
        if (status == ARHOST_STATUS_OK)
            break;
        ASSERT_EQ(status, ARHOST_STATUS_ERROR_OUT_OF_MEMORY) << nth;
        EXPECT_THAT(tracer_->plugin().log().substr(before), HasSubstr(out_of_memory)) << nth;
    }
    EXPECT_GT(nth, 10);
    expect_to_be_mended();
}

// What the first image needs: a place to go to.
TEST_P(FailingDevice, WithoutMemoryInMidRunIsToldOf) {
    ASSERT_EQ(start(), ARHOST_STATUS_OK) << tracer_->plugin().log();
    let_fail("allocate:1");
    EXPECT_THAT(told(ARHOST_STATUS_ERROR_OUT_OF_MEMORY, [&] { return render(); }), HasSubstr(out_of_memory));
    let_fail("");
    EXPECT_EQ(render(), ARHOST_STATUS_OK) << "there is memory again";
    let_fail("allocate:1");
    EXPECT_EQ(tracer_->try_render(from_the_side(small_), *picture_), ARHOST_STATUS_OK)
        << "nothing is allocated per frame";
    expect_to_be_mended();
}

class OldDevice : public LayeredTest, public testing::Test {
protected:
    void SetUp() override {
        ARHOST_REQUIRE_LAYER();
        put_layer_in();
    }

    ScratchFolder folder_;
};

TEST_F(OldDevice, IsRefusedIfAskedFor) {
    const EnvironmentVariable old("ARHOST_TEST_VULKAN_IS_OLD", "all");
    std::ofstream(folder_.path() / "scene.yaml") << small_scene;
    Tracer tracer(scene::load_scene(folder_.path() / "scene.yaml"), {{"device", "0"}}, "rt_vulkan");
    EXPECT_EQ(tracer.start(pinhole(48, 36, 48)), ARHOST_STATUS_ERROR_UNSUPPORTED);
    EXPECT_THAT(tracer.plugin().log(), HasSubstr("knows Vulkan 1.0 only, and 1.1 is needed; choose another with "
                                                 "option 'device'"));
}

TEST_F(OldDevice, IsLeftOutForAnotherWithAReason) {
    const std::string once = copy_drivers(folder_.path() / "a"), again = copy_drivers(folder_.path() / "b");
    if (once.empty())
        GTEST_SKIP() << "the drivers' manifests are not where they are looked for";
    const EnvironmentVariable old("ARHOST_TEST_VULKAN_IS_OLD", "first"),
        drivers("VK_DRIVER_FILES", once + ":" + again), by_old_name("VK_ICD_FILENAMES", once + ":" + again);
    PluginUnderTest plugin("rt_vulkan");
    EXPECT_EQ(plugin.create({}), ARHOST_STATUS_OK) << plugin.log();
    EXPECT_THAT(plugin.log(), HasSubstr("' is left out: it knows Vulkan 1.0 only, and 1.1 is needed"));
}

// ---- The run ---------------------------------------------------------------------------------------

class RunOnIt : public LayeredTest, public testing::Test {
protected:
    static constexpr int frames = 120;
    // Has submissions enough for its start and some tens of frames; a restarted one has as many.
    static constexpr auto in_mid_run = "submit:50";

    void SetUp() override {
#if defined(__SANITIZE_ADDRESS__)
        GTEST_SKIP() << "what drivers leak would be the worker's fault";
#endif
        ARHOST_REQUIRE_LAYER();
    }
    int run(const std::string &when, const std::string &fallback, const std::string &restart) {
        run_.write("scene.yaml", small_scene);
        run_.write("run.yaml",
                   "version: 1\nsource: {plugin: source_counter, options: {frames: " + std::to_string(frames) +
                       ", width: 64, height: 48}}\n" +
                       "tracker: {plugin: tracker_counter, markers: [{id: 3, side_mm: 80}]}\n" +
                       "raytracer: {plugin: rt_vulkan, scene: scene.yaml, allow: [gpu], reads: ['" + layer_folder +
                       "'], environment: [ARHOST_TEST_VULKAN_FAILS]" + fallback +
                       "}\noutputs: [{plugin: sink_counter, path: out/counted.txt}]\nstats: stats.json\n" + restart);
        put_layer_in();
        let_fail(when);
        run_.start();
        const int status = run_.wait();
        lines_ = counted(run_, "out/counted.txt");
        EXPECT_THAT(lines_, SizeIs(frames)) << run_.output();
        for (std::size_t i = 0; i < lines_.size(); ++i)
            EXPECT_EQ(lines_[i].sequence, i) << "out of order";
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
    // Frames between two failures do not count.
    const std::string two_failures_are_enough_ =
        "restart: {proven_after_frames: 1000, quarantine_after: 2, first_delay_ms: 1}\n";
};

TEST_F(RunOnIt, IsMendedByARestartAndLacksNoOverlay) {
    EXPECT_EQ(run(in_mid_run, "", ""), 0) << run_.output();
    EXPECT_THAT(run_.output(), AllOf(HasSubstr(lost), HasSubstr("device lost; ")));
    EXPECT_GE(restarts(), 2) << run_.output();
    EXPECT_EQ(overlaid(), frames);
}

TEST_F(RunOnIt, HandsOverToTheFallbackWhereRestartsDoNotHelp) {
    EXPECT_EQ(run(in_mid_run, ", fallback: rt_embree", two_failures_are_enough_), 0) << run_.output();
    EXPECT_THAT(run_.output(), AllOf(HasSubstr(lost), HasSubstr("falling back to rt_embree")));
    EXPECT_EQ(restarts(), 2) << "one of them the fallback's";
    EXPECT_EQ(overlaid(), frames);
    const auto crashes = run_.stats()["crashes"];
    ASSERT_THAT(crashes, SizeIs(2));
    for (const auto &crash : crashes) {
        EXPECT_GT(crash["frame"], 0) << "in mid-run";
        EXPECT_THAT(crash["how"].get<std::string>(), testing::StartsWith("device lost; "));
    }
}

TEST_F(RunOnIt, GoesOnAsPlainVideoWithoutAFallback) {
    EXPECT_EQ(run(in_mid_run, "", two_failures_are_enough_), 1) << run_.output();
    EXPECT_THAT(run_.output(), AllOf(HasSubstr(lost), HasSubstr("it failed 2 times in a row")));
    EXPECT_GT(overlaid(), 0);
    EXPECT_EQ(lines_.back().kind, ARHOST_OVERLAY_NONE);
}

TEST_F(RunOnIt, WithoutMemoryHandsOverToTheFallback) {
    EXPECT_EQ(run("allocate:1", ", fallback: rt_embree", two_failures_are_enough_), 0) << run_.output();
    EXPECT_THAT(run_.output(), AllOf(HasSubstr(out_of_memory), HasSubstr("falling back to rt_embree")));
    EXPECT_EQ(overlaid(), frames);
}

} // namespace arhost::test
