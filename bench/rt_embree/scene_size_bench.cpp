// SPDX-License-Identifier: Apache-2.0
//
// Measures how rt_embree's costs grow with the size of the scene:
// - the time from an arena to the first frame, relative to a bare rtcCommitScene of the same buffers;
// - the memory, relative to that of the arena and a bare Embree scene;
// - the frame times by numbers of triangles and pixels.
//
//   rt-embree-scene-size [MESH…]     default: dented balls of 5k to 10M triangles
//
// Exits with 1 if, for a MESH, the time exceeds 1.15 times that of the bare commit or the memory exceeds 1.3 times
// that of the bare scene.
#include "bunny.hpp"
#include "renderer.hpp"

#include <glm/trigonometric.hpp>

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace {

using namespace arhost::scene;
using Clock = std::chrono::steady_clock;

constexpr int threads = 2, repetitions = 3;
struct Size {
    std::uint32_t width, height;
};
constexpr Size sizes[] = {{400, 300}, {800, 600}, {1600, 1200}};

double ms_since(Clock::time_point start) {
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

double resident_mb() {
    std::ifstream status("/proc/self/status");
    for (std::string key; status >> key;)
        if (key == "VmRSS:") {
            double kb = 0;
            status >> kb;
            return kb / 1024;
        }
    return 0;
}

// Runs `measure` in a child process and returns its result, because building a BVH of 10M triangles would affect
// later measurements in the same process.
template <class Result> Result in_a_process(const std::function<Result()> &measure) {
    int ends[2];
    if (::pipe(ends) != 0)
        std::abort();
    const pid_t child = ::fork();
    if (child == 0) {
        const Result result = measure();
        (void)!::write(ends[1], &result, sizeof result);
        ::_exit(0);
    }
    ::close(ends[1]);
    Result result{};
    const bool whole = ::read(ends[0], &result, sizeof result) == sizeof result;
    ::close(ends[0]);
    ::waitpid(child, nullptr, 0);
    if (!whole) {
        std::fprintf(stderr, "a child process died during its measurement; possibly there was not enough memory\n");
        std::exit(1);
    }
    return result;
}

Arena scene_of(TriangleMesh mesh) {
    ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(0.2f);
    arhost_material material = make_material(ARHOST_MATERIAL_DIFFUSE);
    std::fill_n(material.diffuse, 3, 0.7f);
    arhost_light lamp = make_light(ARHOST_LIGHT_POINT);
    lamp.position[0] = 80, lamp.position[1] = 200, lamp.position[2] = 150;
    std::fill_n(lamp.intensity, 3, 0.8f);
    builder.add_object("mesh", builder.add_triangles(std::move(mesh)), builder.add_material(material));
    builder.add_light(lamp);
    return std::move(builder).build();
}

// Centres the mesh and scales it to 100 mm, so that all meshes cover a similar part of the image.
void normalise(TriangleMesh &mesh) {
    glm::vec3 low = mesh.positions[0], high = low;
    for (const glm::vec3 &p : mesh.positions) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    const glm::vec3 extent = high - low;
    const float scale = 100 / std::max({extent.x, extent.y, extent.z});
    for (glm::vec3 &p : mesh.positions)
        p = (p - (low + high) * 0.5f) * scale;
}

struct Bare {
    double commit_ms, mb;
};

// Commits an Embree scene of the arena's buffers without rt_embree, but with rt_embree's flags and build quality.
Bare commit_bare(const Arena &arena) {
    const auto *bytes = reinterpret_cast<const std::byte *>(&arena.scene());
    const auto *geometry = reinterpret_cast<const arhost_geometry *>(bytes + arena.scene().geometries.offset);
    const RTCDevice device = rtcNewDevice(("threads=" + std::to_string(threads) + ",set_affinity=0").c_str());
    const RTCScene scene = rtcNewScene(device);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    const RTCGeometry triangles = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    const auto set_buffer = [&](RTCBufferType type, RTCFormat format, const arhost_buffer &buffer) {
        rtcSetSharedGeometryBuffer(triangles, type, 0, format, bytes, buffer.offset, buffer.stride, buffer.count);
    };
    set_buffer(RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, geometry->positions);
    set_buffer(RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, geometry->indices);
    rtcCommitGeometry(triangles);
    rtcAttachGeometry(scene, triangles);
    const auto start = Clock::now();
    rtcCommitScene(scene);
    return {ms_since(start), resident_mb()};
}

struct Ours {
    double first_frame_ms, mb, frame_ms[std::size(sizes)];
};

arhost_camera camera_of(const Size &size) {
    const double f = size.height / 2.0 / std::tan(glm::radians(22.5));
    return {sizeof(arhost_camera),
            0,
            {0, 20, 150},
            {0, 0, 0},
            {0, 1, 0},
            {sizeof(arhost_intrinsics),
             size.width,
             size.height,
             ARHOST_DISTORTION_NONE,
             f,
             f,
             (size.width - 1) / 2.0,
             (size.height - 1) / 2.0,
             0,
             0,
             {},
             {}},
            {}};
}

Ours trace(const Arena &arena) {
    const arhost_host host = arhost::bench::printing_host("rt-embree-scene-size");
    rt_embree::Settings settings;
    settings.threads = threads;
    Ours ours{};
    // 800×600 (index 1) comes first, because the time to the first frame is measured at this size.
    for (const std::size_t i : {std::size_t{1}, std::size_t{0}, std::size_t{2}}) {
        const arhost_camera camera = camera_of(sizes[i]);
        const auto [width, height] = sizes[i];
        std::vector<std::uint8_t> pixels(std::size_t{4} * width * height);
        const arhost_image image{sizeof image, 4 * width, width, height, pixels.data(), nullptr, nullptr};
        const auto start = Clock::now();
        rt_embree::Renderer renderer({sizeof(arhost_raytracer_setup), width, height, ARHOST_IMAGE_FORM_STRAIGHT,
                                      &arena.scene(), &camera.intrinsics, ARHOST_COMPOSITING_SRGB, 0, nullptr},
                                     settings, arhost::Host(&host));
        renderer.render(camera, image);
        if (i == 1) {
            ours.first_frame_ms = ms_since(start);
            ours.mb = resident_mb();
        }
        std::vector<double> times;
        for (int frame = 0; frame < 15; ++frame) {
            const auto begin = Clock::now();
            renderer.render(camera, image);
            times.push_back(ms_since(begin));
        }
        std::nth_element(times.begin(), times.begin() + 7, times.end());
        ours.frame_ms[i] = times[7];
    }
    return ours;
}

bool measure(const std::string &name, TriangleMesh mesh) {
    normalise(mesh);
    const std::size_t triangles = mesh.triangles.size();
    if (mesh.normals.empty())
        mesh.normals = smooth_normals(mesh);
    const Arena arena = scene_of(std::move(mesh));
    // Measures both alternately and keeps the fastest run of each: other load can only slow a run down.
    std::optional<Bare> bare;
    std::optional<Ours> ours;
    for (int i = 0; i < repetitions; ++i) {
        const Bare b = in_a_process<Bare>([&] { return commit_bare(arena); });
        const Ours o = in_a_process<Ours>([&] { return trace(arena); });
        if (!bare || b.commit_ms < bare->commit_ms)
            bare = b;
        if (!ours || o.first_frame_ms < ours->first_frame_ms)
            ours = o;
    }
    std::printf("%-18s %9zu %9.1f %9.1f %7.2f %8.0f %8.0f %7.2f %8.2f %8.2f %8.2f\n", name.c_str(), triangles,
                bare->commit_ms, ours->first_frame_ms, ours->first_frame_ms / bare->commit_ms, bare->mb, ours->mb,
                ours->mb / bare->mb, ours->frame_ms[0], ours->frame_ms[1], ours->frame_ms[2]);
    std::fflush(stdout);
    return ours->first_frame_ms <= 1.15 * bare->commit_ms && ours->mb <= 1.3 * bare->mb;
}

} // namespace

int main(int argc, char **argv) try {
    std::printf(
        "best of %d runs, %d threads; scene: diffuse, one light with shadows, 1 sample; MB: resident memory with the "
        "arena\n%-18s %9s %9s %9s %7s %8s %8s %7s %8s %8s %8s\n",
        repetitions, threads, "mesh", "triangles", "commit ms", "1st fr.ms", "ratio", "bare MB", "ours MB", "ratio",
        "400x300", "800x600", "1600x1200");
    bool met = true;
    if (argc > 1)
        for (int i = 1; i < argc; ++i)
            met &= measure(std::filesystem::path(argv[i]).stem().stem().string(), load_mesh(argv[i]));
    else
        for (const unsigned triangles : {5'000u, 50'000u, 500'000u, 2'000'000u, 10'000'000u})
            measure("ball", arhost::bench::dented_ball(triangles));
    return met ? 0 : 1;
} catch (const std::exception &error) {
    std::fprintf(stderr, "rt-embree-scene-size: %s\n", error.what());
    return 1;
}
