// SPDX-License-Identifier: Apache-2.0
//
// Measures rt_vulkan's speed and leaks.
//
//   rt-vulkan-bench trace bunny|SCENE.yaml WIDTH HEIGHT ROUNDS auto|PATH [EYE_X Y Z AT_X Y Z]
//
// compares the time of an image with that of a bare trace: a shader that traces the same primary rays with the same
// trace(), but writes only distances (bare.glsl). PATH is `plain`, `query` or `pipeline`; `auto` is the one that the
// plugin would choose on this GPU. Prints JSON.
//
//   rt-vulkan-bench run IMAGES EVERY SCENE.yaml…
//
// renders IMAGES images, loads the next scene after every EVERY images, and prints what has leaked. Exits with 1 if a
// target is missed.
#include "bunny.hpp"
#include "long_run.hpp"
#include "renderer.hpp"
#include "spirv/pipeline.rgen.h"
#include "spirv/plain.comp.h"
#include "spirv/query.comp.h"

#include <directories.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>
#include <functional>
#include <numeric>

namespace {

using namespace arhost;

arhost_camera camera_from(const double *eye_and_target, bool z_up, std::uint32_t width, std::uint32_t height) {
    const double f = height / 2 / 0.41421356237309503; // the dissertation's vertical field of view, 45 degrees
    const double *p = eye_and_target;
    return test::camera({p[0], p[1], p[2]}, {p[3], p[4], p[5]}, {0, z_up ? 0.0 : 1.0, z_up ? 1.0 : 0.0},
                        test::pinhole(width, height, f));
}

// Sorts triangles along a Morton curve. Lavapipe's acceleration structures seem to depend on the order of the
// triangles: in the order of the scanned mesh, an image takes seconds.
void sort_along_morton_curve(scene::TriangleMesh &mesh) {
    const auto morton_code = [&](const auto &triangle) {
        const glm::vec3 &p = mesh.positions[triangle[0]]; // within 128 mm of the origin
        std::uint32_t code = 0;
        for (int bit = 9; bit >= 0; --bit)
            for (const float x : {p.x, p.y, p.z})
                code = code << 1 | (static_cast<std::uint32_t>(4 * x + 512) >> bit & 1);
        return code;
    };
    std::sort(mesh.triangles.begin(), mesh.triangles.end(),
              [&](const auto &a, const auto &b) { return morton_code(a) < morton_code(b); });
}

// Returns a scene of the bunny without lights, whose render time is dominated by ray traversal, as in the case
// `primary` of rt_embree_bench.cpp.
scene::Arena unlit_bunny() {
    auto [mesh, name] = bench::bunny(arhost::test::shared_data_directory());
    mesh.normals.clear();
    sort_along_morton_curve(mesh);
    scene::ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(0.2f);
    arhost_material grey = scene::make_material(ARHOST_MATERIAL_DIFFUSE);
    std::fill_n(grey.ambient, 3, 0.7f);
    builder.add_object(name, builder.add_triangles(mesh), builder.add_material(grey));
    return std::move(builder).build();
}

double ms_of(const std::function<void()> &call) {
    const auto start = std::chrono::steady_clock::now();
    call();
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

double median(std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
    return values[values.size() / 2];
}

// Image memory that is page-aligned, so that the device can write to it directly.
class ImageMemory {
public:
    explicit ImageMemory(const arhost_intrinsics &in)
        : image_{sizeof image_, 4 * in.width, in.width, in.height, nullptr, nullptr, nullptr},
          bytes_(static_cast<std::uint8_t *>(
                     std::aligned_alloc(4096, (4ul * in.width * in.height + 4095) / 4096 * 4096)),
                 &std::free) {
        image_.rgba = bytes_.get();
    }
    const arhost_image &image() const { return image_; }
    std::size_t count(const std::function<bool(std::uint32_t)> &predicate) const {
        std::size_t found = 0;
        for (std::size_t i = 0; i < std::size_t{image_.width} * image_.height; ++i) {
            std::uint32_t pixel;
            std::memcpy(&pixel, image_.rgba + 4 * i, sizeof pixel);
            found += predicate(pixel);
        }
        return found;
    }

private:
    arhost_image image_;
    std::unique_ptr<std::uint8_t, decltype(&std::free)> bytes_;
};

// Returns the plugin's shaders for `path`, but with the bare trace instead of the shader that renders the image.
rt_vulkan::Shaders bare_shaders(rt_vulkan::Path path) {
    rt_vulkan::Shaders shaders = rt_vulkan::shaders_of(path);
    using Words = std::span<const std::uint32_t>;
    shaders.stages[0].words = path == rt_vulkan::Path::plain   ? Words(plain_comp)
                              : path == rt_vulkan::Path::query ? Words(query_comp)
                                                               : Words(pipeline_rgen);
    return shaders;
}

nlohmann::json measured(const rt_vulkan::PhysicalDevice &device, const arhost::Host &host, rt_vulkan::Path path,
                        const scene::Arena &arena, const arhost_camera &view, int rounds) {
    const arhost_scene &scene = arena.scene();
    const arhost_raytracer_setup setup{
        sizeof setup, view.intrinsics.width, view.intrinsics.height,  ARHOST_IMAGE_FORM_STRAIGHT,
        &scene,       &view.intrinsics,      ARHOST_COMPOSITING_SRGB, 0,
        nullptr};
    const auto plugin = std::make_unique<rt_vulkan::Renderer>(setup, rt_vulkan::Settings{}, host, device,
                                                              rt_vulkan::shaders_of(path));
    const auto bare =
        std::make_unique<rt_vulkan::Renderer>(setup, rt_vulkan::Settings{}, host, device, bare_shaders(path));

    scene::MotionEvaluator evaluator(scene);
    const arhost_motion motion = evaluator.at(0);
    const arhost_motion *moving = scene.duration_s > 0 ? &motion : nullptr;
    const ImageMemory picture(view.intrinsics), distances(view.intrinsics);
    plugin->render(view, picture.image(), moving); // warm-up
    bare->render(view, distances.image(), moving);
    const std::size_t drawn = picture.count([](std::uint32_t pixel) { return pixel >> 24 == 255; });
    const std::size_t hit = distances.count([](std::uint32_t bits) { return bits < 0x7f800000; });

    const VkCommandBuffer commands = bare->submission().new_commands();
    bare->submission().begin(commands);
    bare->record_shader(commands);
    bare->submission().end(commands);
    const double gpu_before = plugin->gpu_ms(), read_back_before = plugin->read_back_ms();
    std::vector<double> frames, bares;
    for (int i = 0; i < rounds; ++i) {
        const auto frame = [&] { frames.push_back(ms_of([&] { plugin->render(view, picture.image(), moving); })); };
        const auto trace = [&] { bares.push_back(ms_of([&] { bare->submission().run(commands); })); };
        i % 2 ? frame() : trace();
        i % 2 ? trace() : frame();
    }
    const double whole = std::accumulate(frames.begin(), frames.end(), 0.0);
    return {{"path", rt_vulkan::name_of(path)},
            {"frame_ms", median(frames)},
            {"bare_ms", median(bares)},
            {"drawn", drawn},
            {"hit", hit},
            {"gpu_share", (plugin->gpu_ms() - gpu_before) / whole},
            {"read_back_share", (plugin->read_back_ms() - read_back_before) / whole},
            {"in_place", plugin->wrote_in_place()}};
}

int trace(const std::vector<std::string> &words) {
    const std::string &scene_name = words[1];
    const auto width = static_cast<std::uint32_t>(std::stoul(words[2])),
               height = static_cast<std::uint32_t>(std::stoul(words[3]));
    const bool is_bunny = scene_name == "bunny";
    double from[6] = {0, 50, 170, 0, 50, 169};
    for (std::size_t i = 0; i < 6 && words.size() == 12; ++i)
        from[i] = std::stod(words[6 + i]);
    scene::LoadCallbacks callbacks; // print to stderr, where gpu.py finds the name of the loaded mesh
    callbacks.info = callbacks.warning = [](const std::string &text) { std::fprintf(stderr, "%s\n", text.c_str()); };
    const scene::Arena arena =
        is_bunny ? unlit_bunny() : scene::load_scene(std::filesystem::path(scene_name), callbacks).build();

    const arhost_host printing = bench::printing_host("rt-vulkan-bench");
    const arhost::Host host(&printing);
    const rt_vulkan::Instance instance(host, false);
    const auto devices = instance.devices();
    const rt_vulkan::PhysicalDevice &device = rt_vulkan::choose_device(devices, "auto");
    nlohmann::json line = measured(
        device, host, rt_vulkan::choose_paths(device, words[5])[0], arena,
        camera_from(from, arena.scene().axes == ARHOST_AXES_Z_UP && !is_bunny, width, height), std::stoi(words[4]));
    line["device"] = device.name;
    line["is_gpu"] = device.properties.deviceType != VK_PHYSICAL_DEVICE_TYPE_CPU;
    for (const rt_vulkan::Path path : device.paths)
        line["paths"].push_back(rt_vulkan::name_of(path));
    std::printf("%s\n", line.dump().c_str());
    return 0;
}

// Runs twice: without the validation layers, because their memory would be counted as well, then with them.
int run(const std::vector<std::string> &words) {
    constexpr double max_growth_mib = 2;
    const int images = std::stoi(words[1]), every = std::stoi(words[2]);
    const std::vector<std::filesystem::path> scenes(words.begin() + 3, words.end());
    bool has_missed = false;
    const auto verdict = [&](bool is_met) {
        has_missed |= !is_met;
        return is_met ? "" : ", MISSED";
    };
    std::printf("%d images of %zu scenes; the scene changes every %d images\n", images, scenes.size(), every);
    const test::LongRun plain = test::long_run(scenes, images / every, every, {});
    // Growth is counted from the middle of the run, because caches fill during the first half.
    const test::LongRun::State &middle = plain.states[plain.states.size() / 2], &last = plain.states.back();
    const double growth_mib = last.memory_mib - middle.memory_mib;
    std::printf("  memory at half time and at the end  %.1f, %.1f MiB (target: growth of at most %g MiB%s)\n",
                middle.memory_mib, last.memory_mib, max_growth_mib, verdict(growth_mib <= max_growth_mib));
    std::printf("  file descriptors                    %td, %td (target: no growth%s)\n", middle.files, last.files,
                verdict(last.files <= middle.files));
    std::fflush(stdout);
    const test::LongRun validated = test::long_run(scenes, images / every, every, {{"validate", "true"}});
    std::printf("  validation messages                 %zu (target: none%s)\n", validated.validation_messages(),
                verdict(validated.validation_messages() == 0));
    if (validated.validation_messages())
        std::fprintf(stderr, "%s", validated.log.c_str());
    return has_missed;
}

} // namespace

int main(int argc, char **argv) try {
    const std::vector<std::string> words(argv + 1, argv + argc);
    if ((words.size() == 6 || words.size() == 12) && words[0] == "trace")
        return trace(words);
    if (words.size() > 3 && words[0] == "run")
        return run(words);
    std::fprintf(stderr,
                 "usage: rt-vulkan-bench trace bunny|SCENE.yaml WIDTH HEIGHT ROUNDS auto|PATH [EYE_X Y Z AT_X Y Z]\n"
                 "       rt-vulkan-bench run IMAGES EVERY SCENE.yaml...\n");
    return 2;
} catch (const std::exception &error) {
    std::fprintf(stderr, "rt-vulkan-bench: %s\n", error.what());
    return 1;
}
