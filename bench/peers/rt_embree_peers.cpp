// SPDX-License-Identifier: Apache-2.0
//
// Runs rt_embree for the benchmark `tools/bench peers`, which compares it with other ray tracers (the peers).
// `rt-embree-peers FOLDER THREADS` first writes the scene for the peers to FOLDER: scene.json, and the mesh as raw
// numbers. Then, for each line "CASE FRAMES" on standard input, it renders FRAMES frames of that case, prints their
// times as one line of JSON, and writes the last image to FOLDER/ours-CASE.rgba. If built with COUNT_RAYS, it also
// prints the number of rays per frame, but counting makes the times meaningless.
#include "bunny.hpp"
#include "renderer.hpp"

#include <directories.hpp>
#include <glm/trigonometric.hpp>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace {

std::atomic<std::uint64_t> rays_traced{0};

}

#ifdef COUNT_RAYS
// The linker redirects rt_embree's calls of Embree to the wrappers below, which count rays (see CMakeLists.txt).
namespace {
void count(const int *valid, int width) {
    std::uint64_t active = 0;
    for (int i = 0; i < width; ++i)
        active += valid[i] != 0;
    rays_traced.fetch_add(active, std::memory_order_relaxed);
}
} // namespace
#if RTC_VERSION_MAJOR >= 4
#define WRAP(kind, width, rays, arguments)                                                                           \
    extern "C" void __real_rtc##kind##width(const int *, RTCScene, rays *, arguments *);                             \
    extern "C" void __wrap_rtc##kind##width(const int *valid, RTCScene scene, rays *r, arguments *a) {               \
        count(valid, width);                                                                                         \
        __real_rtc##kind##width(valid, scene, r, a);                                                                 \
    }
#else
#define WRAP(kind, width, rays, arguments)                                                                           \
    extern "C" void __real_rtc##kind##width(const int *, RTCScene, RTCIntersectContext *, rays *);                   \
    extern "C" void __wrap_rtc##kind##width(const int *valid, RTCScene scene, RTCIntersectContext *c, rays *r) {     \
        count(valid, width);                                                                                         \
        __real_rtc##kind##width(valid, scene, c, r);                                                                 \
    }
#endif
WRAP(Intersect, 4, RTCRayHit4, RTCIntersectArguments)
WRAP(Intersect, 8, RTCRayHit8, RTCIntersectArguments)
WRAP(Intersect, 16, RTCRayHit16, RTCIntersectArguments)
WRAP(Occluded, 4, RTCRay4, RTCOccludedArguments)
WRAP(Occluded, 8, RTCRay8, RTCOccludedArguments)
WRAP(Occluded, 16, RTCRay16, RTCOccludedArguments)
#endif

namespace {

using namespace arhost::scene;

constexpr std::uint32_t width = 800, height = 600;
constexpr double fov_y_degrees = 45;
constexpr float eye[3] = {0, 50, 170}, look_at[3] = {0, 50, 0};
constexpr float lamp_position[3] = {80, 200, 150}, lamp_intensity = 40'000; // divided by d², d in mm
constexpr float ground_half_side = 200;                                     // mm, at y = 0
constexpr float bunny_grey = 0.6f, ground_grey = 0.5f, mirror_grey = 0.9f;
// Glass loses 5 % of the light at each bounce, so that a wrong path length is visible in the picture.
constexpr float glass_grey = 0.95f, glass_index = 1.5f;
constexpr std::uint32_t mirror_depth = 8, glass_depth = 20; // bounces

TriangleMesh ground() {
    const float a = ground_half_side;
    return {{{-a, 0, -a}, {-a, 0, a}, {a, 0, a}, {a, 0, -a}}, {}, {}, {{0, 1, 2}, {0, 2, 3}}};
}

arhost_material grey(arhost_material_model model, float value) {
    arhost_material material = make_material(model);
    for (int i = 0; i < 3; ++i) {
        material.ambient[i] = 0;
        if (model == ARHOST_MATERIAL_DIFFUSE)
            material.diffuse[i] = value;
        else
            material.reflectivity[i] = material.refraction[i] = value;
    }
    return material;
}

struct Case {
    Arena arena;
    rt_embree::Settings settings;
};

Case make_case(const std::string &name, const TriangleMesh &mesh, unsigned threads) {
    Case made{Arena(64), {}};
    made.settings.threads = threads;
    ArenaBuilder builder;
    builder.settings.axes = ARHOST_AXES_Y_UP;
    builder.settings.ambient = glm::vec3(0);
    builder.settings.background = glm::vec3(1);
    arhost_material material = grey(ARHOST_MATERIAL_DIFFUSE, bunny_grey);
    const bool is_glass = name.starts_with("glass");
    if (name == "mirror") {
        material = grey(ARHOST_MATERIAL_MIRROR, mirror_grey);
        builder.settings.max_depth = mirror_depth;
    } else if (is_glass) {
        material = grey(ARHOST_MATERIAL_GLASS, glass_grey);
        material.index = glass_index;
        material.fresnel_minimum = std::pow((glass_index - 1) / (glass_index + 1), 2.0f);
        // In "glass-path", only the depth limits a path, as in the peers. "glass-tree" also cuts off rays whose
        // throughput is below 0.01, a common value.
        material.importance_cutoff = name == "glass-tree" ? 0.01f : 0;
        builder.settings.max_depth = glass_depth;
        made.settings.single_path = name == "glass-path";
    } else if (name != "diffuse") {
        throw std::runtime_error("unknown case: " + name);
    }
    builder.add_object("bunny", builder.add_triangles(mesh), builder.add_material(material));
    if (!is_glass) {
        builder.add_object("ground", builder.add_triangles(ground()),
                           builder.add_material(grey(ARHOST_MATERIAL_DIFFUSE, ground_grey)));
        arhost_light light = make_light(ARHOST_LIGHT_POINT);
        light.falloff = ARHOST_FALLOFF_INVERSE_SQUARE;
        for (int i = 0; i < 3; ++i) {
            light.position[i] = lamp_position[i];
            light.intensity[i] = lamp_intensity;
        }
        builder.add_light(light);
    }
    made.arena = std::move(builder).build();
    return made;
}

arhost_camera camera() {
    const double f = height / 2 / std::tan(glm::radians(fov_y_degrees / 2));
    const arhost_intrinsics intrinsics{sizeof(arhost_intrinsics),
                                       width,
                                       height,
                                       ARHOST_DISTORTION_NONE,
                                       f,
                                       f,
                                       (width - 1) / 2.0,
                                       (height - 1) / 2.0,
                                       0,
                                       0,
                                       {},
                                       {}};
    return {sizeof(arhost_camera),
            0,
            {eye[0], eye[1], eye[2]},
            {look_at[0], look_at[1], look_at[2]},
            {0, 1, 0},
            intrinsics,
            {}};
}

class Trial {
public:
    Trial(Case made)
        : case_(std::move(made)), pixels_(width * height * 4),
          renderer_({sizeof(arhost_raytracer_setup), width, height, ARHOST_IMAGE_FORM_STRAIGHT, &case_.arena.scene(),
                     &camera_.intrinsics, ARHOST_COMPOSITING_SRGB, 0, nullptr},
                    case_.settings, arhost::Host(&host_)) {}
    void render() {
        renderer_.render(camera_, {sizeof(arhost_image), width * 4, width, height, pixels_.data(), nullptr, nullptr});
    }
    const std::vector<std::uint8_t> &pixels() const { return pixels_; }
    const rt_embree::Renderer &renderer() const { return renderer_; }

private:
    arhost_host host_ = arhost::bench::printing_host("rt-embree-peers");
    Case case_;
    arhost_camera camera_ = camera();
    std::vector<std::uint8_t> pixels_;
    rt_embree::Renderer renderer_;
};

void write(const std::filesystem::path &file, const void *bytes, std::size_t count) {
    std::ofstream out(file, std::ios::binary);
    out.write(static_cast<const char *>(bytes), static_cast<std::streamsize>(count));
    if (!out.flush())
        throw std::runtime_error("cannot write " + file.string());
}

void write_scene(const std::filesystem::path &folder, const TriangleMesh &mesh, const std::string &name) {
    write(folder / "positions.f32", mesh.positions.data(), mesh.positions.size() * sizeof mesh.positions[0]);
    write(folder / "normals.f32", mesh.normals.data(), mesh.normals.size() * sizeof mesh.normals[0]);
    write(folder / "triangles.u32", mesh.triangles.data(), mesh.triangles.size() * sizeof mesh.triangles[0]);
    char text[1000];
    const int length = std::snprintf(
        text, sizeof text,
        R"({"mesh": "%s", "triangles": %zu, "width": %u, "height": %u, "fov_y_degrees": %g,
"eye": [%g, %g, %g], "look_at": [%g, %g, %g], "lamp_position": [%g, %g, %g], "lamp_intensity": %g,
"ground_half_side": %g, "bunny_grey": %g, "ground_grey": %g, "mirror_grey": %g, "glass_grey": %g,
"glass_index": %g, "mirror_depth": %u, "glass_depth": %u}
)",
        name.c_str(), mesh.triangles.size(), width, height, fov_y_degrees, eye[0], eye[1], eye[2], look_at[0],
        look_at[1], look_at[2], lamp_position[0], lamp_position[1], lamp_position[2], lamp_intensity,
        ground_half_side, bunny_grey, ground_grey, mirror_grey, glass_grey, glass_index, mirror_depth, glass_depth);
    write(folder / "scene.json", text, static_cast<std::size_t>(length));
}

void serve(const std::filesystem::path &folder, unsigned threads) {
    const auto [mesh, mesh_name] = arhost::bench::bunny(arhost::test::shared_data_directory());
    write_scene(folder, mesh, mesh_name);
    std::printf(R"({"name": "arhost rt_embree", "version": "Embree %d.%d"})"
                "\n",
                RTC_VERSION_MAJOR, RTC_VERSION_MINOR);
    std::fflush(stdout);

    std::map<std::string, std::unique_ptr<Trial>> trials;
    std::string name;
    for (int frames; std::cin >> name >> frames;) {
        std::unique_ptr<Trial> &trial = trials[name];
        if (!trial)
            trial = std::make_unique<Trial>(make_case(name, mesh, threads));
        trial->render(); // warm the caches
        std::string wall, cpu;
        const std::uint64_t rays = rays_traced;
        for (int i = 0; i < frames; ++i) {
            const auto start = std::chrono::steady_clock::now();
            const std::clock_t cpu_start = std::clock();
            trial->render();
            const char *separator = i ? ", " : "";
            cpu += separator + std::to_string(1e3 * static_cast<double>(std::clock() - cpu_start) / CLOCKS_PER_SEC);
            wall += separator +
                    std::to_string(
                        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
        }
        write(folder / ("ours-" + name + ".rgba"), trial->pixels().data(), trial->pixels().size());
        std::printf(R"({"wall_ms": [%s], "cpu_ms": [%s], "rays": %.0f, "kernel": "%s"})"
                    "\n",
                    wall.c_str(), cpu.c_str(), static_cast<double>(rays_traced - rays) / std::max(frames, 1),
                    trial->renderer().kernel_name());
        std::fflush(stdout);
    }
}

} // namespace

int main(int argc, char **argv) {
    if (argc != 3) {
        std::fputs("usage: rt-embree-peers FOLDER THREADS\n", stderr);
        return 2;
    }
    try {
        serve(argv[1], static_cast<unsigned>(std::atoi(argv[2])));
    } catch (const std::exception &error) {
        std::fprintf(stderr, "rt-embree-peers: %s\n", error.what());
        return 1;
    }
}
