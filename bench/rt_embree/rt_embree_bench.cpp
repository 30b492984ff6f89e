// SPDX-License-Identifier: Apache-2.0
//
// Prints frame times of rt_embree, and the times of bare Embree calls for the same primary rays:
// `rt-embree-bench [threads [instruction_set [primary|diffuse|mirror|glass]]]`.
#include "bunny.hpp"
#include "renderer.hpp"

#include <directories.hpp>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <string>
#include <vector>

namespace {

using namespace arhost::scene;

constexpr std::uint32_t width = 800, height = 600;
constexpr int rounds = 101;

arhost_light lamp() {
    arhost_light light = make_light(ARHOST_LIGHT_POINT);
    light.position[0] = 80, light.position[1] = 200, light.position[2] = 150;
    for (float &channel : light.intensity)
        channel = 0.8f;
    return light;
}

Arena scene_of(const TriangleMesh &mesh, const arhost_material &material, bool lit) {
    ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(0.2f);
    builder.settings.max_depth = 10;
    builder.add_object("bunny", builder.add_triangles(mesh), builder.add_material(material));
    if (lit)
        builder.add_light(lamp());
    return std::move(builder).build();
}

// Median times of a frame. `cpu_ms` is the CPU time of all threads together, which depends less on other load than
// the elapsed time `ms`.
struct Timing {
    double ms, cpu_ms;
};

double median(std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
    return values[values.size() / 2];
}

Timing time_frames(const std::function<void()> &frame) {
    std::vector<double> wall, cpu;
    for (int i = 0; i < rounds; ++i) {
        const auto start = std::chrono::steady_clock::now();
        const std::clock_t cpu_start = std::clock();
        frame();
        cpu.push_back(1e3 * static_cast<double>(std::clock() - cpu_start) / CLOCKS_PER_SEC);
        wall.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
    }
    return {median(wall), median(cpu)};
}

void report(const char *what, const Timing &timing) {
    std::printf("%-28s %7.2f ms   %7.2f ms of CPU\n", what, timing.ms, timing.cpu_ms);
}

arhost_intrinsics intrinsics() {
    const double f = height / 2 / std::tan(glm::radians(22.5));
    return {sizeof(arhost_intrinsics),
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
}

// Returns a camera in whose image the bunny fills the height.
arhost_camera camera() {
    return {sizeof(arhost_camera), 0, {0, 50, 170}, {0, 50, 169}, {0, 1, 0}, intrinsics(), {}};
}

class Trial {
public:
    Trial(const Arena &arena, const rt_embree::Settings &settings)
        : pixels_(width * height * 4),
          renderer_({sizeof(arhost_raytracer_setup), width, height, ARHOST_IMAGE_FORM_STRAIGHT, &arena.scene(),
                     &camera_.intrinsics, ARHOST_COMPOSITING_SRGB, 0, nullptr},
                    settings, arhost::Host(&host_)) {}

    Timing time() {
        const arhost_image image{sizeof image, width * 4, width, height, pixels_.data(), nullptr, nullptr};
        return time_frames([&] { renderer_.render(camera_, image); });
    }
    double covered() const {
        std::size_t count = 0;
        for (std::size_t i = 3; i < pixels_.size(); i += 4)
            count += pixels_[i] == 255;
        return static_cast<double>(count) / (width * height);
    }
    const rt_embree::Renderer &renderer() const { return renderer_; }

private:
    arhost_host host_ = arhost::bench::printing_host("rt-embree-bench");
    arhost_camera camera_ = camera();
    std::vector<std::uint8_t> pixels_;
    rt_embree::Renderer renderer_;
};

// Times only Embree's intersection calls: with the same blocks, tiles and threads as the renderer, but with
// precomputed rays and without shading. Uses packets of the processor's native width if `native_width`, else
// rtcIntersect16.
Timing time_bare_intersect(const Arena &arena, const rt_embree::Settings &settings, bool native_width) {
    const arhost_host host = arhost::bench::printing_host("rt-embree-bench");
    rt_embree::ThreadPool threads(settings.threads);
    const rt_embree::RayTable table(intrinsics(), false, threads);
    const rt_embree::EmbreeScene scene(arena.scene(), threads.thread_count(), settings.robust, arhost::Host(&host));
    struct alignas(64) Directions {
        float x[16], y[16], z[16];
    };
    std::vector<std::vector<Directions>> tiles;
    for (const rt_embree::Tile &tile : table.tiles()) {
        auto &directions = tiles.emplace_back();
        for (int y = tile.pixels.y0; y < tile.pixels.y1; y += 4)
            for (int x = tile.pixels.x0; x < tile.pixels.x1; x += 4) {
                Directions d;
                for (int i = 0; i < 16; ++i) {
                    const auto direction =
                        table.direction(std::min<int>(x + i % 4, width - 1), std::min<int>(y + i / 4, height - 1));
                    d.x[i] = direction.x, d.y[i] = -direction.y, d.z[i] = -1;
                }
                directions.push_back(d);
            }
    }
    const arhost_camera from = camera();
    const int packet_width = native_width ? scene.view().packet_width : 16;
    return time_frames([&] {
        threads.for_each(tiles.size(), [&](std::size_t i, std::size_t) {
            rt_embree::Query query = rt_embree::make_query(rt_embree::Coherence::coherent);
            alignas(64) int valid[16];
            std::fill_n(valid, 16, -1);
            RTCRayHit16 rays;
            for (int lane = 0; lane < 16; ++lane) {
                rays.ray.org_x[lane] = static_cast<float>(from.eye[0]);
                rays.ray.org_y[lane] = static_cast<float>(from.eye[1]);
                rays.ray.org_z[lane] = static_cast<float>(from.eye[2]);
                rays.ray.tnear[lane] = rays.ray.time[lane] = 0;
                rays.ray.mask[lane] = rt_embree::all_masks;
                rays.ray.flags[lane] = 0;
                rays.hit.instID[0][lane] = RTC_INVALID_GEOMETRY_ID;
            }
            for (const Directions &d : tiles[i]) {
                std::copy_n(d.x, 16, rays.ray.dir_x);
                std::copy_n(d.y, 16, rays.ray.dir_y);
                std::copy_n(d.z, 16, rays.ray.dir_z);
                std::fill_n(rays.ray.tfar, 16, INFINITY);
                std::fill_n(rays.hit.geomID, 16, RTC_INVALID_GEOMETRY_ID);
                rt_embree::intersect16(valid, scene.view().root, packet_width, query, rays);
            }
        });
    });
}

} // namespace

int main(int argc, char **argv) {
    rt_embree::Settings settings;
    if (argc > 1)
        settings.threads = static_cast<unsigned>(std::atoi(argv[1]));
    if (argc > 2)
        settings.instruction_set = argv[2];

    const auto [mesh, name] = arhost::bench::bunny(arhost::test::shared_data_directory());
    arhost_material diffuse = make_material(ARHOST_MATERIAL_DIFFUSE), mirror = make_material(ARHOST_MATERIAL_MIRROR);
    for (int i = 0; i < 3; ++i) {
        diffuse.ambient[i] = diffuse.diffuse[i] = 0.7f - 0.1f * static_cast<float>(i);
        mirror.reflectivity[i] = 0.9f;
    }
    TriangleMesh flat = mesh;
    flat.normals.clear();
    const std::string only = argc > 3 ? argv[3] : "";
    if (!only.empty() && only != "primary" && only != "diffuse" && only != "mirror" && only != "glass") {
        std::fprintf(stderr, "rt-embree-bench: unknown case '%s'; use primary, diffuse, mirror or glass\n",
                     only.c_str());
        return 2;
    }
    const auto selected = [&](const char *name) { return only.empty() || only == name; };

    if (selected("primary")) {
        const Arena unlit = scene_of(flat, diffuse, false);
        Trial visibility(unlit, settings);
        const Timing visible = visibility.time();
        std::printf("%s of %zu triangles, %ux%u px, 1 sample, %u threads, %s; covers %.0f %% of the image; "
                    "p50 of %d frames\n",
                    name, mesh.triangles.size(), width, height, visibility.renderer().thread_count(),
                    visibility.renderer().kernel_name(), 100 * visibility.covered(), rounds);
        report("primary visibility", visible);
        const auto compare = [&](const char *what, const Timing &bare) {
            report(what, bare);
            std::printf("%-28s %7.1f %%    %7.1f %%\n", "speed of primary visibility", 100 * bare.ms / visible.ms,
                        100 * bare.cpu_ms / visible.cpu_ms);
        };
        if (only.empty()) {
            compare("bare rtcIntersect16 loop", time_bare_intersect(unlit, settings, false));
            compare("bare loop, native packets", time_bare_intersect(unlit, settings, true));
        }
    }
    const auto time = [&](const char *key, const char *what, const arhost_material &material) {
        if (!selected(key))
            return;
        const Arena arena = scene_of(mesh, material, true);
        report(what, Trial(arena, settings).time());
    };
    time("diffuse", "diffuse and shadows", diffuse);
    time("mirror", "mirror, up to 10 bounces", mirror);
    time("glass", "glass, ray tree to depth 10", make_material(ARHOST_MATERIAL_GLASS));
}
