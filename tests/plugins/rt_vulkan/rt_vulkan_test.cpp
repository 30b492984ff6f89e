// SPDX-License-Identifier: Apache-2.0
//
// Tests rt_vulkan on this machine's Vulkan device, and its error messages if the machine has no device.
#include "drivers_leak.hpp"
#include "environment_variable.hpp"
#include "failure_of.hpp"
#include "large_surfaces.hpp"
#include "rejected_input.hpp"
#include "renderer.hpp"
#include "scene/scene_loader.hpp"
#include "two_tracers.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <fstream>
#include <list>
#include <memory>
#include <optional>

namespace arhost::test {
namespace {

using testing::HasSubstr;

// The host of this plugin is for the objects that the tests construct without the plugin.
struct LoggingHost : PluginUnderTest {
    LoggingHost() : PluginUnderTest("rt_vulkan") {}
};

template <class Call> std::string rejection(arhost_status expected, Call call) {
    const auto [status, message] = failure_of(call);
    EXPECT_EQ(status, expected) << message;
    return message;
}

const arhost_intrinsics small = pinhole(96, 72, 96);

void expect_rt_embrees_picture(const arhost_camera &view, const Options &options, const std::string &path = "auto") {
    Options with_path = options;
    with_path["path"] = path;
    const Picture got = picture_by("rt_vulkan", rich_scene(), view, with_path);
    const Likeness like = likeness(got, picture_by("rt_embree", rich_scene(), view, options));
    EXPECT_LE(like.alphas_off, like.pixels / 1000) << like;
    EXPECT_EQ(like.alphas_off_inside, 0) << like;
    EXPECT_GE(like.psnr(), 45) << like;
    EXPECT_GT(like.inside, 300) << like;
    std::cout << like << std::endl;
}

} // namespace

// ---- Equality with rt_embree -----------------------------------------------------------------------

class RichScene : public testing::Test {
protected:
    void SetUp() override { ARHOST_REQUIRE_VULKAN(); }
};

TEST_F(RichScene, SeveralSamplesMatchRtEmbree) {
    expect_rt_embrees_picture(from_the_side(small), {{"samples", "3"}, {"light_samples", "2"}});
}
TEST_F(RichScene, OnePathThroughGlassMatchesRtEmbree) {
    expect_rt_embrees_picture(from_the_side(small), {{"glass", "path"}});
}
TEST_F(RichScene, LensMatchesRtEmbree) {
    expect_rt_embrees_picture(from_the_side(with_lens(small, ARHOST_DISTORTION_BROWN, {-0.3, 0.1, 0.001, -0.002})),
                              {});
    expect_rt_embrees_picture(from_the_side(with_lens(small, ARHOST_DISTORTION_FISHEYE, {0.02, -0.01, 0, 0})),
                              {{"samples", "2"}});
}
TEST_F(RichScene, AccumulatedMatchesRtEmbree) {
    const Options options{{"accumulate", "true"}, {"samples", "2"}};
    Tracer vulkan(rich_scene(), options, "rt_vulkan"), embree(rich_scene(), options);
    const arhost_camera view = from_the_side(small);
    const auto first = vulkan.render(view).pixels();
    embree.render(view);
    for (Tracer *tracer : {&vulkan, &embree})
        tracer->render_next(view);
    const Likeness like = likeness(vulkan.render_next(view), embree.render_next(view));
    EXPECT_EQ(like.alphas_off, 0) << like;
    EXPECT_GE(like.psnr(), 45) << like;
    // Each change of the camera restarts the accumulation, including a change back to the first camera.
    vulkan.render_next(camera({0, 0, 200}, {0, 0, 0}, {0, 1, 0}, small));
    EXPECT_EQ(vulkan.render_next(view).pixels(), first);
    // A cancelled image restarts the accumulation as well. The second image after a start is still traced in bands,
    // so it can be cancelled after the first band.
    Picture picture = vulkan.render(view);
    vulkan.plugin().cancel(1);
    ASSERT_EQ(vulkan.try_render(view, picture), ARHOST_STATUS_ERROR_CANCELLED);
    vulkan.plugin().reset_cancel();
    EXPECT_EQ(vulkan.render_next(view).pixels(), first);
}
TEST_F(RichScene, RepeatedGivesTheSameBytes) {
    Tracer tracer(rich_scene(), {}, "rt_vulkan");
    const auto first = tracer.render(from_the_side(small)).pixels();
    tracer.render(from_the_side(pinhole(64, 48, 64)));
    EXPECT_EQ(tracer.render(from_the_side(small)).pixels(), first);
}

// ---- Each traversal path ---------------------------------------------------------------------------

namespace {

arhost_camera moving_camera(const arhost_intrinsics &intrinsics = small) {
    return camera({25, -330, 150}, {0, 0, 50}, {0, 0, 1}, intrinsics);
}

const std::string moving_scene = arhost::test::source_directory() + "/config/scenes/moving.yaml";
const auto all_paths = testing::Values("plain", "query", "pipeline");

// Holds the objects that are needed to construct a Renderer for a path.
struct RendererParts {
    explicit RendererParts(const std::string &path)
        : device(rt_vulkan::choose_device(instance.devices(), "auto")),
          shaders(rt_vulkan::shaders_of(rt_vulkan::choose_paths(device, path)[0])) {}
    rt_vulkan::Renderer renderer(const arhost_raytracer_setup &setup, const rt_vulkan::Settings &settings = {}) {
        return {setup, settings, host, device, shaders};
    }
    LoggingHost logging;
    const Host host{logging.host()};
    const rt_vulkan::Instance instance{host, false};
    const rt_vulkan::PhysicalDevice device;
    const rt_vulkan::Shaders shaders;
};

std::string name_of_path(const testing::TestParamInfo<std::string> &info) {
    return info.param;
}

} // namespace

class EachPath : public testing::TestWithParam<std::string> {
protected:
    void SetUp() override { ARHOST_REQUIRE_VULKAN(GetParam()); }
};
INSTANTIATE_TEST_SUITE_P(Paths, EachPath, all_paths, name_of_path);

TEST_P(EachPath, MatchesRtEmbree) {
    expect_rt_embrees_picture(from_the_side(small), {}, GetParam());
}

TEST_P(EachPath, MatchesRtEmbreeWithARoundSpotLamp) {
    const auto scene = [] {
        SceneBuilder builder({.background = glm::vec3(0)});
        arhost_light lamp = placed(ARHOST_LIGHT_SPOT, {0, -60, 80}, 0.8f);
        set3(lamp.direction, 0, 0.6f, -0.8f);
        lamp.cosine_inner = 0.95f;
        lamp.cosine_outer = 0.7f;
        lamp.radius = 8;
        builder.add_light(lamp);
        builder.add_mesh("floor", square(90), diffuse(0.7f, 0.7f, 0.7f));
        builder.add_ball("mirror", {0, 0, 20, 20}, mirror(0.8f));
        return builder;
    };
    const Options options{{"samples", "4"}};
    Options with_path = options;
    with_path["path"] = GetParam();
    const Likeness like = likeness(picture_by("rt_vulkan", scene(), from_the_side(small), with_path),
                                   picture_by("rt_embree", scene(), from_the_side(small), options));
    EXPECT_EQ(like.alphas_off, 0) << like;
    EXPECT_GE(like.psnr(), 45) << like;
    EXPECT_GT(like.inside, 300) << like;
}

TEST_P(EachPath, DoesNotSelfShadowLargeSurfaces) {
    for (const LargeSurface &surface : large_surfaces)
        EXPECT_EQ(pixels_out_of_light(surface, "rt_vulkan", {{"path", GetParam()}}), 0) << surface;
}

TEST_P(EachPath, KeepsContactShadowsOnALargeFloor) {
    for (const float side_mm : {1e2f, 1e6f}) {
        Tracer tracer(plate_on_floor(side_mm), {{"path", GetParam()}}, "rt_vulkan");
        EXPECT_TRUE(has_its_shadow(tracer.render(camera_over_plate()))) << side_mm;
    }
}

TEST_P(EachPath, CancelsAnImageAndContinues) {
    Tracer tracer(scene::load_scene(moving_scene), {{"path", GetParam()}}, "rt_vulkan");
    ASSERT_EQ(tracer.start(small), ARHOST_STATUS_OK) << tracer.log();
    Picture picture(small);
    const std::vector<Pixel> untouched = picture.pixels();
    tracer.plugin().cancel(1); // cancels after the first band
    EXPECT_EQ(tracer.try_render_at(0.7, moving_camera(), picture), ARHOST_STATUS_ERROR_CANCELLED);
    EXPECT_THAT(tracer.log(), HasSubstr("cancelled while tracing the image"));
    EXPECT_EQ(picture.pixels(), untouched);
    tracer.plugin().reset_cancel();
    const std::vector<Pixel> after = tracer.render_at(0.3, moving_camera()).pixels();
    ASSERT_EQ(tracer.start(small), ARHOST_STATUS_OK);
    EXPECT_EQ(after, tracer.render_at(0.3, moving_camera()).pixels());
}

// `arena` and `intrinsics` must outlive the result.
arhost_raytracer_setup straight_setup(const scene::Arena &arena, const arhost_intrinsics &intrinsics) {
    arhost_raytracer_setup setup{};
    setup.struct_size = sizeof setup;
    setup.width = intrinsics.width;
    setup.height = intrinsics.height;
    setup.form = ARHOST_IMAGE_FORM_STRAIGHT;
    setup.scene = &arena.scene();
    setup.intrinsics = &intrinsics;
    setup.compositing = ARHOST_COMPOSITING_SRGB;
    return setup;
}

TEST_P(EachPath, TracesTheSamePictureInBandsAndAtOnce) {
    RendererParts parts(GetParam());
    scene::Arena arena = rich_scene().build();
    for (const std::uint32_t height : {1u, 7u, 65u, 72u}) {
        const arhost_intrinsics in = pinhole(96, height, 96);
        const arhost_raytracer_setup setup = straight_setup(arena, in);
        // Renders three images and returns the third. The first image always uses bands, because its time is not yet
        // known; the second may use them.
        const auto third = [&](rt_vulkan::Bands::Milliseconds max_band_time) {
            rt_vulkan::Settings settings;
            settings.max_band_time = max_band_time;
            rt_vulkan::Renderer renderer = parts.renderer(setup, settings);
            rt_vulkan::Rectangle drawn{};
            Picture picture(in);
            for (int image = 0; image < 3; ++image) {
                const int checks = parts.logging.cancel_checks();
                drawn = renderer.render(from_the_side(in), picture.image());
                const int expected = max_band_time.count() > 0 ? 1 : static_cast<int>((height + 7) / 8);
                EXPECT_TRUE(image < 2 || parts.logging.cancel_checks() - checks == expected)
                    << "expected one cancellation check per band";
            }
            EXPECT_TRUE(picture.only_pixels_written());
            return std::tuple(picture.pixels(), drawn.x, drawn.y, drawn.width, drawn.height);
        };
        EXPECT_EQ(third(std::chrono::milliseconds(0)), third(std::chrono::hours(1))) << height;
    }
}

TEST_P(EachPath, AcceptsChangesOfOptions) {
    expect_changed_options_apply("rt_vulkan", {{"path", GetParam()}}, small);
    expect_changed_options_apply("rt_vulkan", {{"path", GetParam()}, {"accumulate", "true"}}, small);
}

TEST_P(EachPath, IsLogged) {
    Tracer tracer(rich_scene(), {{"path", GetParam()}}, "rt_vulkan");
    ASSERT_EQ(tracer.start(small), ARHOST_STATUS_OK);
    EXPECT_THAT(tracer.log(), HasSubstr("path " + GetParam() + ","));
}

// Some of these images also rebuild acceleration structures, which counts as device time.
TEST_P(EachPath, ReportsTheDeviceTimeIfTheStructHasTheField) {
    const bool has_clock = RendererParts(GetParam()).device.timestamp_bits > 0;
    Tracer tracer(scene::load_scene(moving_scene), {{"path", GetParam()}}, "rt_vulkan");
    ASSERT_EQ(tracer.start(small), ARHOST_STATUS_OK) << tracer.log();
    for (const double time_s : {0.0, 0.5, 1.0}) {
        const auto begin = std::chrono::steady_clock::now();
        const arhost_render_info info = tracer.render_at(time_s, moving_camera()).info;
        const std::chrono::nanoseconds took = std::chrono::steady_clock::now() - begin;
        EXPECT_EQ(info.device_time_ns > 0, has_clock);
        EXPECT_LE(info.device_time_ns, static_cast<std::uint64_t>(took.count()));
    }
    constexpr std::uint64_t untouched = 7;
    Picture picture(small);
    picture.info = {offsetof(arhost_render_info, device_time_ns), 0, 0, 0, 0, 0, untouched, untouched, 0};
    ASSERT_EQ(tracer.try_render_at(1.5, moving_camera(), picture), ARHOST_STATUS_OK);
    EXPECT_EQ(picture.info.device_time_ns, untouched) << "an older host's struct lacks the field";
    EXPECT_TRUE(picture.info.has_region);
}

// Compares images after many refits and several rebuilds of the acceleration structures.
TEST_P(EachPath, FollowsMotion) {
    const arhost_intrinsics tiny = pinhole(48, 36, 48);
    Tracer tracer(scene::load_scene(moving_scene), {{"path", GetParam()}}, "rt_vulkan"),
        embree(scene::load_scene(moving_scene));
    ASSERT_EQ(tracer.start(tiny), ARHOST_STATUS_OK) << tracer.log();
    ASSERT_EQ(embree.start(tiny), ARHOST_STATUS_OK);
    constexpr int frames = 130; // includes more than two rebuild intervals
    for (int frame = 0; frame < frames; ++frame) {
        const Picture got = tracer.render_at(0.1 * frame, moving_camera(tiny));
        if (frame % 13)
            continue;
        const Likeness like = likeness(got, embree.render_at(0.1 * frame, moving_camera(tiny)));
        EXPECT_LE(like.alphas_off, like.pixels / 500) << "frame " << frame << ": " << like;
        EXPECT_EQ(like.alphas_off_inside, 0) << "frame " << frame << ": " << like;
        EXPECT_GE(like.psnr(), 40) << "frame " << frame << ": " << like;
    }
}

TEST_P(EachPath, RendersSeveralScenesInTurn) {
    RendererParts parts(GetParam());
    const auto picture_of = [&](scene::ArenaBuilder scene, const arhost_camera &view) {
        scene::Arena arena = std::move(scene).build();
        const arhost_raytracer_setup setup = straight_setup(arena, view.intrinsics);
        rt_vulkan::Renderer renderer = parts.renderer(setup);
        Picture picture(small);
        const rt_vulkan::Rectangle drawn = renderer.render(view, picture.image());
        EXPECT_EQ(drawn.width > 0, picture.alphas().rbegin()->first > 0);
        return picture.pixels();
    };
    const auto first = picture_of(rich_scene(), from_the_side(small));
    const auto second = picture_of(scene::load_scene(moving_scene), moving_camera());
    EXPECT_NE(first, second);
    const auto nothing = picture_of(scene::ArenaBuilder(), moving_camera());
    EXPECT_EQ(std::count(nothing.begin(), nothing.end(), Pixel{0, 0, 0, 0}), small.width * small.height);
    EXPECT_EQ(picture_of(rich_scene(), from_the_side(small)), first);
}

// ---- Image memory ----------------------------------------------------------------------------------

// The device can write directly to page-aligned memory, such as the host's slots. It must not write the row padding.
TEST(Image, IsWrittenInPlaceIfTheDeviceImportsItsMemory) {
    ARHOST_REQUIRE_VULKAN();
    RendererParts parts("plain");
    if (!parts.device.imports_host_memory)
        GTEST_SKIP() << parts.device.name << " does not support VK_EXT_external_memory_host";
    scene::Arena arena = rich_scene().build();
    const arhost_camera view = from_the_side(small);
    const arhost_raytracer_setup setup = straight_setup(arena, view.intrinsics);
    rt_vulkan::Renderer renderer = parts.renderer(setup);

    const std::uint32_t stride = 4 * small.width + 64;
    const std::size_t size = std::size_t{stride} * small.height, pages = (size + 4095) / 4096 * 4096;
    auto *memory =
        static_cast<std::uint8_t *>(mmap(nullptr, pages, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
    std::memset(memory, 0xa5, pages);
    std::list<Picture> pictures; // the last one does not begin at a page
    do
        pictures.emplace_back(small);
    while (reinterpret_cast<std::uintptr_t>(pictures.back().image().rgba) % 4096 == 0);
    Picture &copied = pictures.back();
    const arhost_image in_place{sizeof in_place, stride, small.width, small.height, memory, nullptr, nullptr};
    const rt_vulkan::Rectangle drawn = renderer.render(view, in_place);
    if (!renderer.wrote_in_place() && parts.device.properties.deviceType != VK_PHYSICAL_DEVICE_TYPE_CPU)
        GTEST_SKIP() << parts.device.name << " does not import shared memory"; // such as AMD's Linux driver
    EXPECT_TRUE(renderer.wrote_in_place());
    const arhost_image elsewhere = copied.image(); // aligned to 64 bytes only
    renderer.render(view, elsewhere);
    EXPECT_FALSE(renderer.wrote_in_place());
    EXPECT_TRUE(copied.only_pixels_written());
    std::size_t differ = 0, touched = 0;
    for (std::uint32_t y = 0; y < small.height; ++y) {
        const std::uint8_t *row = memory + std::size_t{stride} * y;
        differ += std::memcmp(row, elsewhere.rgba + std::size_t{elsewhere.stride} * y, 4 * small.width) != 0;
        for (std::uint32_t i = 4 * small.width; i < stride; ++i)
            touched += row[i] != 0xa5;
    }
    for (std::size_t i = size; i < pages; ++i)
        touched += memory[i] != 0xa5;
    EXPECT_EQ(differ, 0u) << "number of rows that differ";
    EXPECT_EQ(touched, 0u) << "number of changed bytes outside the image";
    munmap(memory, pages);

    EXPECT_EQ((std::array{drawn.x, drawn.y, drawn.x + drawn.width, drawn.y + drawn.height}), copied.bounds());
}

// ---- Vulkan loader, device, traversal path, pipeline cache -----------------------------------------

TEST(Loader, ReportsAMissingLibrary) {
    LoggingHost logging;
    EXPECT_THAT(
        rejection(ARHOST_STATUS_ERROR_UNSUPPORTED,
                  [&] { rt_vulkan::Instance(Host(logging.host()), false, "libvulkan-none.so.1"); }),
        testing::AllOf(HasSubstr("no Vulkan loader"), HasSubstr("libvulkan-none.so.1"), HasSubstr("libvulkan1")));
    EXPECT_THAT(rejection(ARHOST_STATUS_ERROR_UNSUPPORTED,
                          [&] { rt_vulkan::Instance(Host(logging.host()), false, "libm.so.6"); }),
                HasSubstr("libm.so.6 is not a Vulkan loader"));
}

TEST(Device, ReportsAMissingDriver) {
    const EnvironmentVariable drivers("VK_DRIVER_FILES", "/nonexistent/none.json"),
        old_name("VK_ICD_FILENAMES", "/nonexistent/none.json");
    PluginUnderTest plugin("rt_vulkan");
    EXPECT_EQ(plugin.create(), ARHOST_STATUS_ERROR_UNSUPPORTED);
    EXPECT_TRUE(plugin.log().find("no Vulkan loader") != std::string::npos ||
                plugin.log().find("VK_DRIVER_FILES is '/nonexistent/none.json'") != std::string::npos)
        << plugin.log();
    EXPECT_THAT(plugin.log(), testing::AnyOf(HasSubstr("no Vulkan driver: install"),
                                             HasSubstr("no Vulkan device: install"), HasSubstr("no Vulkan loader")));
}

TEST(Device, IsChosenByNumberNameOrUuid) {
    using rt_vulkan::PhysicalDevice;
    PhysicalDevice usable{};
    usable.properties.apiVersion = VK_API_VERSION_1_1;
    usable.properties.limits.maxPerStageDescriptorStorageBuffers = 15;
    std::vector<PhysicalDevice> devices(3, usable);
    devices[0].name = "llvmpipe (LLVM 15)";
    devices[0].uuid = "6d657361000000000000000000000000";
    devices[0].properties.deviceType = VK_PHYSICAL_DEVICE_TYPE_CPU;
    devices[1].name = "Big GPU";
    devices[1].uuid = "00112233445566778899aabbccddeeff";
    devices[1].properties.deviceType = VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU;
    devices[2].name = "Little GPU";
    devices[2].uuid = "0f112233445566778899aabbccddeeff";
    devices[2].properties.deviceType = VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU;
    const auto chosen = [&](const char *wanted) { return rt_vulkan::choose_device(devices, wanted).name; };
    EXPECT_EQ(chosen("auto"), "Big GPU");
    EXPECT_EQ(chosen("0"), "llvmpipe (LLVM 15)");
    EXPECT_EQ(chosen("2"), "Little GPU");
    EXPECT_EQ(chosen("LLVMPIPE"), "llvmpipe (LLVM 15)");
    EXPECT_EQ(chosen("little"), "Little GPU");
    EXPECT_EQ(chosen("15"), "llvmpipe (LLVM 15)")
        << "no device has the number 15, so it is matched with a part of the name";
    devices[2].name = "Big GPU Ti";
    EXPECT_EQ(chosen("big gpu"), "Big GPU") << "a whole name takes precedence over a part";
    devices[2].name = "Little GPU";
    EXPECT_EQ(chosen("0F112233-4455-6677-8899-aabbccddeeff"), "Little GPU");
    for (const char *none : {"3", "radeon", "", "0011"})
        EXPECT_THAT(rejection(ARHOST_STATUS_ERROR_CONFIGURATION, [&] { chosen(none); }),
                    testing::AllOf(HasSubstr("option 'device': no device matches"), HasSubstr("1 'Big GPU'"),
                                   HasSubstr("6d657361")))
            << none;
    EXPECT_THAT(rejection(ARHOST_STATUS_ERROR_CONFIGURATION, [&] { chosen("gpu"); }), HasSubstr("more than one"));
    devices[1].properties.limits.maxPerStageDescriptorStorageBuffers = 13;
    EXPECT_EQ(chosen("auto"), "Little GPU") << "'Big GPU' supports too few storage buffers";
    EXPECT_EQ(chosen("big"), "Big GPU") << "a device selected by name is checked only at start";
    devices[2].properties.apiVersion = VK_API_VERSION_1_0;
    EXPECT_EQ(chosen("auto"), "llvmpipe (LLVM 15)");
    devices[0].queue_family = VK_QUEUE_FAMILY_IGNORED;
    EXPECT_EQ(chosen("auto"), "llvmpipe (LLVM 15)") << "without a usable device, the first one is chosen";
}

TEST(Path, IsChosenFromThoseTheDeviceSupports) {
    using rt_vulkan::Path;
    using Paths = std::vector<Path>;
    rt_vulkan::PhysicalDevice device{};
    device.name = "Little GPU";
    device.properties.deviceType = VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU;
    const auto chosen = [&](const char *wanted) { return rt_vulkan::choose_paths(device, wanted); };
    EXPECT_EQ(chosen("auto"), Paths{Path::plain});
    EXPECT_THAT(rejection(ARHOST_STATUS_ERROR_CONFIGURATION, [&] { chosen("query"); }),
                testing::AllOf(HasSubstr("option 'path'"), HasSubstr("'Little GPU' does not support 'query'"),
                               HasSubstr("it supports plain")));
    device.paths = {Path::plain, Path::query};
    EXPECT_EQ(chosen("auto"), (Paths{Path::query, Path::plain}));
    EXPECT_EQ(chosen("plain"), Paths{Path::plain});
    EXPECT_THAT(rejection(ARHOST_STATUS_ERROR_CONFIGURATION, [&] { chosen("pipeline"); }),
                HasSubstr("it supports plain, query"));
    device.paths = {Path::plain, Path::query, Path::pipeline};
    EXPECT_EQ(chosen("auto"), (Paths{Path::pipeline, Path::query, Path::plain}));
    EXPECT_EQ(chosen("query"), Paths{Path::query});
    device.properties.deviceType = VK_PHYSICAL_DEVICE_TYPE_CPU;
    EXPECT_EQ(chosen("auto"), Paths{Path::plain});
    EXPECT_EQ(chosen("pipeline"), Paths{Path::pipeline});
}

TEST(Device, RejectsAnUnknownName) {
    ARHOST_REQUIRE_VULKAN();
    PluginUnderTest plugin("rt_vulkan");
    EXPECT_EQ(plugin.create({{"device", "no such device"}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(plugin.log(), HasSubstr("available: 0 '"));
    EXPECT_EQ(plugin.create({{"device", "0"}}), ARHOST_STATUS_OK);
}

TEST(Device, IsListedByTheHost) {
#if defined(__SANITIZE_ADDRESS__)
    GTEST_SKIP() << "the leak checker would report leaks of Vulkan drivers, and arhost would fail";
#endif
    ARHOST_REQUIRE_VULKAN();
    const std::string text = output_of(arhost::test::build_directory() + "/bin/arhost devices rt_vulkan 2>&1");
    LoggingHost logging;
    for (const auto &device : rt_vulkan::Instance(Host(logging.host()), false).devices()) {
        EXPECT_THAT(text, HasSubstr(device.name));
        EXPECT_THAT(text, HasSubstr(device.uuid));
        const std::string missing = rt_vulkan::missing_requirement(device);
        EXPECT_THAT(text, HasSubstr(missing.empty() ? "paths: " + rt_vulkan::list_of(device.paths) : missing));
    }
}

TEST(Device, RejectsADeviceThatLacksARequirement) {
    ARHOST_REQUIRE_VULKAN();
    LoggingHost logging;
    const Host host(logging.host());
    const rt_vulkan::Instance instance(host, false);
    const rt_vulkan::PhysicalDevice usable = instance.devices()[0];
    const auto shaders = rt_vulkan::shaders_of(rt_vulkan::Path::plain);
    scene::Arena arena = rich_scene().build();
    const arhost_raytracer_setup setup = straight_setup(arena, small);
    const auto complaint = [&](auto change) {
        rt_vulkan::PhysicalDevice device = usable;
        change(device);
        return rejection(ARHOST_STATUS_ERROR_UNSUPPORTED,
                         [&] { rt_vulkan::Renderer(setup, {}, host, device, shaders); });
    };
    EXPECT_THAT(complaint([](auto &device) { device.properties.apiVersion = VK_API_VERSION_1_0; }),
                testing::AllOf(HasSubstr(usable.name), HasSubstr("1.1 is required"), HasSubstr("option 'device'")));
    EXPECT_THAT(complaint([](auto &device) { device.queue_family = VK_QUEUE_FAMILY_IGNORED; }),
                HasSubstr("has no compute queue"));
    EXPECT_THAT(complaint([](auto &device) { device.properties.limits.maxPerStageDescriptorStorageBuffers = 14; }),
                HasSubstr("supports 14 storage buffers per stage; 15 are required"));
    EXPECT_THAT(complaint([](auto &device) { device.properties.limits.maxStorageBufferRange = 64; }),
                HasSubstr("supports at most 1 MiB; reduce their size"));
}

TEST(PipelineCache, IsKeptAndSurvivesBadFiles) {
    ARHOST_REQUIRE_VULKAN();
    const ScratchFolder folder;
    const EnvironmentVariable caches("XDG_CACHE_HOME", folder.path().string());
    Tracer tracer(scene::ArenaBuilder(), {}, "rt_vulkan"); // with an empty scene, the shader compiles quickly
    const auto files = [&] {                               // without Mesa's own caches, which are in the same folder
        std::vector<std::filesystem::path> files;
        for (const auto &entry : std::filesystem::directory_iterator(folder.path()))
            if (entry.path().filename().string().starts_with("rt_vulkan"))
                files.push_back(entry);
        return files;
    };
    ASSERT_EQ(tracer.start(small), ARHOST_STATUS_OK) << tracer.log();
    ASSERT_THAT(files(), testing::SizeIs(1));
    const auto file = files()[0];
    EXPECT_THAT(file.filename(), testing::ResultOf([](const auto &name) { return name.string(); },
                                                   testing::ContainsRegex("^rt_vulkan-[0-9a-f]{32}.pipelines$")))
        << "the name must identify the device";
    const auto size = std::filesystem::file_size(file);
    std::ofstream(file) << "garbage";
    EXPECT_EQ(tracer.start(small), ARHOST_STATUS_OK) << tracer.log();
    EXPECT_EQ(std::filesystem::file_size(file), size) << "the plugin must rewrite the file";
    std::filesystem::resize_file(file, (std::uintmax_t{64} << 20) + 1); // larger than the plugin's limit
    EXPECT_EQ(tracer.start(small), ARHOST_STATUS_OK) << tracer.log();
    EXPECT_EQ(std::filesystem::file_size(file), size) << "the plugin must rewrite the file";
    std::filesystem::remove(file);
    std::filesystem::create_directory(file); // rename() cannot replace a folder
    EXPECT_EQ(tracer.start(small), ARHOST_STATUS_OK) << tracer.log();
    EXPECT_EQ(files(), std::vector{file}) << "a temporary file was left";
    const EnvironmentVariable relative("XDG_CACHE_HOME", "a-relative-folder");
    EXPECT_EQ(tracer.start(small), ARHOST_STATUS_OK) << tracer.log();
    EXPECT_FALSE(std::filesystem::exists("a-relative-folder"));
}

// ---- Validation ------------------------------------------------------------------------------------

class Validation : public testing::Test {
protected:
    void SetUp() override {
        ARHOST_REQUIRE_VULKAN();
        try {
            rt_vulkan::Instance(Host(logging.host()), true);
        } catch (const Failure &failure) {
            GTEST_SKIP() << failure.what();
        }
    }
    // Writes zeros to a buffer with this usage, without barriers between the writes.
    void write_buffer(VkBufferUsageFlags usage, int times) {
        const Host host(logging.host());
        const rt_vulkan::Instance instance(host, true);
        const auto devices = instance.devices();
        const rt_vulkan::Device device(devices[0]);
        ASSERT_EQ(logging.log(), "");
        const rt_vulkan::Submission submission(device);
        const rt_vulkan::Buffer buffer(device, 64, usage, rt_vulkan::Buffer::Place::device);
        const VkCommandBuffer commands = submission.new_commands();
        submission.begin(commands);
        const std::int32_t zeros[4] = {};
        for (int i = 0; i < times; ++i)
            device.functions().vkCmdUpdateBuffer(commands, buffer.get(), 0, sizeof zeros, zeros);
        submission.end(commands);
    }
    LoggingHost logging;
};

TEST_F(Validation, ReportsAMissingUsageFlag) {
    write_buffer(VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, 1); // invalid: the buffer lacks the usage TRANSFER_DST
    EXPECT_THAT(logging.log(), HasSubstr("Vulkan validation: "));
}

TEST_F(Validation, ReportsAWriteAfterWriteHazard) {
    write_buffer(VK_BUFFER_USAGE_TRANSFER_DST_BIT, 2);
    EXPECT_THAT(logging.log(), HasSubstr("HAZARD"));
}

class ValidationOfPath : public Validation, public testing::WithParamInterface<std::string> {
protected:
    void SetUp() override {
        ARHOST_REQUIRE_VULKAN(GetParam());
        Validation::SetUp();
    }
};
INSTANTIATE_TEST_SUITE_P(Paths, ValidationOfPath, all_paths, name_of_path);

TEST_P(ValidationOfPath, ReportsNothing) {
    Tracer tracer(rich_scene(), {{"validate", "true"}, {"accumulate", "true"}, {"path", GetParam()}}, "rt_vulkan");
    ASSERT_EQ(tracer.start(small), ARHOST_STATUS_OK) << tracer.log();
    for (int frame = 0; frame < 5; ++frame) // the first image is traced in bands, the third and later ones at once
        tracer.render_next(from_the_side(small));
    for (const char *samples : {"2", "1"}) {
        EXPECT_EQ(tracer.plugin().set_text("samples", samples), ARHOST_STATUS_OK);
        tracer.render_next(from_the_side(small));
    }
    tracer.render(from_the_side(pinhole(65, 47, 65))); // restarts the plugin with another image size
    EXPECT_THAT(tracer.log(), testing::Not(HasSubstr("Vulkan validation: ")));
    EXPECT_THAT(tracer.log(), HasSubstr("with the validation layers"));
}

TEST_P(ValidationOfPath, ReportsNothingForMotion) {
    Tracer tracer(scene::load_scene(moving_scene), {{"validate", "true"}, {"path", GetParam()}}, "rt_vulkan");
    ASSERT_EQ(tracer.start(small), ARHOST_STATUS_OK) << tracer.log();
    std::vector<std::vector<Pixel>> pictures;
    for (const double time_s : {0.0, 0.7, 0.0, 0.3})
        pictures.push_back(tracer.render_at(time_s, moving_camera()).pixels());
    EXPECT_NE(pictures[0], pictures[1]);
    EXPECT_EQ(pictures[0], pictures[2]);
    EXPECT_THAT(tracer.log(), testing::Not(HasSubstr("Vulkan validation: ")));
}

// ---- Invalid input ---------------------------------------------------------------------------------

TEST(InvalidInput, CamerasAreRejected) {
    ARHOST_REQUIRE_VULKAN();
    expect_invalid_cameras_are_rejected("rt_vulkan", 1e13);
}

TEST(InvalidInput, IntrinsicsAreRejected) {
    ARHOST_REQUIRE_VULKAN();
    expect_invalid_intrinsics_are_rejected("rt_vulkan");
}

TEST(InvalidInput, CancelledCallsFail) {
    ARHOST_REQUIRE_VULKAN();
    expect_cancelled_calls_fail("rt_vulkan");
}

TEST(Plugin, DeclaresLensDistortionAndGpuUse) {
    const PluginUnderTest plugin("rt_vulkan");
    EXPECT_TRUE(plugin.descriptor().capabilities & ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION);
    ASSERT_NE(plugin.descriptor().needs, nullptr);
    EXPECT_STREQ(plugin.descriptor().needs[0], "gpu");
}

} // namespace arhost::test
