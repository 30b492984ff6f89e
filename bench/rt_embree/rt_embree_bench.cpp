// SPDX-License-Identifier: Apache-2.0
//
// Prints frame times of rt_embree, and the times of bare Embree calls for the same primary rays and for the shadow
// rays of light samples: `rt-embree-bench [threads [instruction_set [primary|diffuse|mirror|glass|light]]]`.
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
#include <random>
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

// The lamp of time_light_samples(): a horizontal square that shines downwards.
constexpr float lamp_height = 250, lamp_half_side = 60;

// The bunny on a table below an area lamp, which alone lights them.
Arena room_of(const TriangleMesh &mesh, const arhost_material &material) {
    ArenaBuilder builder;
    builder.settings.background = glm::vec3(0);
    builder.settings.integrator = ARHOST_INTEGRATOR_PATH;
    builder.add_object("bunny", builder.add_triangles(mesh), builder.add_material(material));
    const TriangleMesh table{
        {{-300, 30, -300}, {-300, 30, 300}, {300, 30, 300}, {300, 30, -300}}, {}, {}, {{0, 1, 2}, {0, 2, 3}}};
    builder.add_object("table", builder.add_triangles(table), builder.add_material(material));
    arhost_light light = make_light(ARHOST_LIGHT_RECTANGLE);
    light.falloff = ARHOST_FALLOFF_INVERSE_SQUARE;
    light.position[1] = lamp_height;
    light.direction[1] = -1, light.direction[2] = 0;
    light.axis_u[0] = light.axis_v[2] = lamp_half_side;
    light.axis_v[1] = 0;
    for (float &channel : light.intensity)
        channel = 30'000;
    builder.add_light(light);
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
    arhost::raytracer_common::ThreadPool threads(settings.threads);
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

// Times only Embree's occlusion calls for `count` light samples of each pixel that shows a surface, with precomputed
// rays to random points of the lamp.
Timing time_bare_shadow_rays(const Arena &arena, const rt_embree::Settings &settings, int count) {
    const arhost_host host = arhost::bench::printing_host("rt-embree-bench");
    arhost::raytracer_common::ThreadPool threads(settings.threads);
    const rt_embree::RayTable table(intrinsics(), false, threads);
    const rt_embree::EmbreeScene scene(arena.scene(), threads.thread_count(), settings.robust, arhost::Host(&host));
    const int packet_width = scene.view().packet_width;
    const arhost_camera from = camera();
    std::minstd_rand random(1);
    std::uniform_real_distribution<float> on_lamp(-lamp_half_side, lamp_half_side);
    struct Packet {
        alignas(64) int valid[16];
        RTCRay16 rays;
    };
    std::vector<std::vector<Packet>> tiles;
    for (const rt_embree::Tile &tile : table.tiles()) {
        auto &packets = tiles.emplace_back();
        for (int y = tile.pixels.y0; y < tile.pixels.y1; y += 4)
            for (int x = tile.pixels.x0; x < tile.pixels.x1; x += 4) {
                RTCRayHit16 primary{};
                Packet packet{};
                for (int i = 0; i < 16; ++i) {
                    const auto direction =
                        table.direction(std::min<int>(x + i % 4, width - 1), std::min<int>(y + i / 4, height - 1));
                    primary.ray.org_x[i] = static_cast<float>(from.eye[0]);
                    primary.ray.org_y[i] = static_cast<float>(from.eye[1]);
                    primary.ray.org_z[i] = static_cast<float>(from.eye[2]);
                    primary.ray.dir_x[i] = direction.x, primary.ray.dir_y[i] = -direction.y;
                    primary.ray.dir_z[i] = -1;
                    primary.ray.tfar[i] = INFINITY;
                    primary.ray.mask[i] = rt_embree::all_masks;
                    primary.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
                    packet.valid[i] = -1;
                }
                rt_embree::Query query = rt_embree::make_query(rt_embree::Coherence::coherent);
                rt_embree::intersect16(packet.valid, scene.view().root, packet_width, query, primary);
                for (int sample = 0; sample < count; ++sample) {
                    packet.rays = primary.ray;
                    for (int i = 0; i < 16; ++i) {
                        const float *const origin[] = {primary.ray.org_x, primary.ray.org_y, primary.ray.org_z};
                        const float *const along[] = {primary.ray.dir_x, primary.ray.dir_y, primary.ray.dir_z};
                        const float *const normal[] = {primary.hit.Ng_x, primary.hit.Ng_y, primary.hit.Ng_z};
                        const float target[] = {on_lamp(random), lamp_height, on_lamp(random)};
                        float *const to_origin[] = {packet.rays.org_x, packet.rays.org_y, packet.rays.org_z};
                        float *const to_direction[] = {packet.rays.dir_x, packet.rays.dir_y, packet.rays.dir_z};
                        float cosine = 0, towards_eye = 0;
                        for (int axis = 0; axis < 3; ++axis) {
                            const float hit = origin[axis][i] + along[axis][i] * primary.ray.tfar[i] * 0.9999f;
                            to_origin[axis][i] = hit;
                            to_direction[axis][i] = target[axis] - hit;
                            cosine += normal[axis][i] * to_direction[axis][i];
                            towards_eye -= normal[axis][i] * along[axis][i];
                        }
                        packet.rays.tfar[i] = 1;
                        const bool is_lit =
                            primary.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID && cosine * towards_eye > 0;
                        packet.valid[i] = is_lit ? -1 : 0;
                    }
                    if (std::any_of(packet.valid, packet.valid + 16, [](int valid) { return valid != 0; }))
                        packets.push_back(packet);
                }
            }
    }
    bool traces = true;
    const auto frame = [&] {
        threads.for_each(tiles.size(), [&](std::size_t i, std::size_t) {
            rt_embree::Query query = rt_embree::make_query(rt_embree::Coherence::incoherent);
            RTCRay16 rays;
            for (const Packet &packet : tiles[i]) {
                rays = packet.rays; // Embree writes tfar
                if (traces)
                    rt_embree::occluded16(packet.valid, scene.view().root, packet_width, query, rays);
                asm volatile("" : : "r"(&rays) : "memory"); // keeps the compiler from omitting the copy
            }
        });
    };
    const Timing all = time_frames(frame);
    traces = false;
    const Timing reading = time_frames(frame); // of the packets, from main memory
    return {all.ms - reading.ms, all.cpu_ms - reading.cpu_ms};
}

// Compares a further light sample of the path integrator with its bare shadow ray. Returns whether it takes at most
// 1.5 times as long.
bool time_light_samples(const TriangleMesh &mesh, const arhost_material &material, rt_embree::Settings settings) {
    constexpr int more = 8;
    const Arena room = room_of(mesh, material);
    settings.light_samples = 1;
    const Timing one = Trial(room, settings).time();
    settings.light_samples = 1 + more;
    const Timing many = Trial(room, settings).time(), bare = time_bare_shadow_rays(room, settings, more);
    report("path, 1 light sample", one);
    report("path, 9 light samples", many);
    report("8 bare shadow rays", bare);
    const double ratio = (many.cpu_ms - one.cpu_ms) / bare.cpu_ms;
    std::printf("a further light sample takes %.2f times as long as a bare shadow ray (CPU time; target: 1.5: %s)\n",
                ratio, ratio <= 1.5 ? "met" : "MISSED");
    return ratio <= 1.5;
}

} // namespace

int main(int argc, char **argv) {
    rt_embree::Settings settings;
    if (argc > 1)
        settings.threads = static_cast<unsigned>(std::atoi(argv[1]));
    if (argc > 2)
        settings.instruction_set = arhost::raytracer_common::choose_instruction_set(argv[2]);

    const auto [mesh, name] = arhost::bench::bunny(arhost::test::shared_data_directory());
    arhost_material diffuse = make_material(ARHOST_MATERIAL_DIFFUSE), mirror = make_material(ARHOST_MATERIAL_MIRROR);
    for (int i = 0; i < 3; ++i) {
        diffuse.ambient[i] = diffuse.diffuse[i] = 0.7f - 0.1f * static_cast<float>(i);
        mirror.reflectivity[i] = 0.9f;
    }
    TriangleMesh flat = mesh;
    flat.normals.clear();
    const std::string only = argc > 3 ? argv[3] : "";
    if (!only.empty() && only != "primary" && only != "diffuse" && only != "mirror" && only != "glass" &&
        only != "light") {
        std::fprintf(stderr, "rt-embree-bench: unknown case '%s'; use primary, diffuse, mirror, glass or light\n",
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
    const bool is_met = !selected("light") || time_light_samples(mesh, diffuse, settings);
    return only == "light" && !is_met ? 1 : 0;
}
