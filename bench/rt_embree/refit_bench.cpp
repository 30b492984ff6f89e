// SPDX-License-Identifier: Apache-2.0
//
// `rt-embree-refit` determines the degradation at which rebuilding a BVH pays off. For increasingly deformed meshes,
// it prints the degradation that BvhQuality measures, and the times to trace rays through a refitted and a rebuilt
// BVH.
#include "bunny.hpp"
#include "embree_scene.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <random>
#include <vector>

namespace {

using namespace arhost::scene;
using Clock = std::chrono::steady_clock;

double ms_of(const std::function<void()> &work) {
    const auto start = Clock::now();
    work();
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

double median_of(int runs, const std::function<void()> &work) {
    std::vector<double> times;
    for (int i = 0; i < runs; ++i)
        times.push_back(ms_of(work));
    std::nth_element(times.begin(), times.begin() + runs / 2, times.end());
    return times[static_cast<std::size_t>(runs / 2)];
}

class Bvh {
public:
    Bvh(RTCDevice device, std::vector<glm::vec3> &positions, const TriangleMesh &mesh)
        : scene_(rtcNewScene(device)), geometry_(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE)) {
        rtcSetSceneFlags(scene_.get(), RTC_SCENE_FLAG_DYNAMIC);
        rtcSetSceneBuildQuality(scene_.get(),
                                RTC_BUILD_QUALITY_LOW); // gives each geometry its own BVH, which can be refitted
        rtcSetSharedGeometryBuffer(geometry_.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, positions.data(), 0,
                                   sizeof(glm::vec3), positions.size());
        rtcSetSharedGeometryBuffer(geometry_.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.triangles.data(),
                                   0, sizeof mesh.triangles[0], mesh.triangles.size());
        rtcSetGeometryBuildQuality(geometry_.get(), RTC_BUILD_QUALITY_MEDIUM);
        rtcCommitGeometry(geometry_.get());
        rtcAttachGeometry(scene_.get(), geometry_.get());
        rtcCommitScene(scene_.get());
    }
    void update(RTCBuildQuality quality) {
        rtcSetGeometryBuildQuality(geometry_.get(), quality);
        rtcUpdateGeometryBuffer(geometry_.get(), RTC_BUFFER_TYPE_VERTEX, 0);
        rtcCommitGeometry(geometry_.get());
        rtcCommitScene(scene_.get());
    }
    // Traces the primary rays of a 640×480 frame in packets. The camera is 200 mm from the mesh's centre.
    void trace() const {
        alignas(64) int valid[16];
        std::fill_n(valid, 16, -1);
        rt_embree::Query query = rt_embree::make_query(rt_embree::Coherence::coherent);
        const int width = rt_embree::native_packet_width(rtcGetSceneDevice(scene_.get()));
        for (int packet = 0; packet < 640 * 480 / 16; ++packet) {
            RTCRayHit16 rays;
            for (int i = 0; i < 16; ++i) {
                const int x = packet % 160 * 4 + i % 4, y = packet / 160 * 4 + i / 4;
                rays.ray.org_x[i] = rays.ray.org_y[i] = 0;
                rays.ray.org_z[i] = 200;
                rays.ray.dir_x[i] = (static_cast<float>(x) - 320) / 700;
                rays.ray.dir_y[i] = (static_cast<float>(y) - 240) / 700;
                rays.ray.dir_z[i] = -1;
                rays.ray.tnear[i] = rays.ray.time[i] = 0;
                rays.ray.tfar[i] = INFINITY;
                rays.ray.mask[i] = -1;
                rays.ray.flags[i] = 0;
                rays.hit.geomID[i] = rays.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
            }
            rt_embree::intersect16(valid, scene_.get(), width, query, rays);
        }
    }

private:
    rt_embree::SceneHandle scene_;
    rt_embree::GeometryHandle geometry_;
};

void measure(const char *name, const TriangleMesh &mesh, std::initializer_list<float> amounts,
             const std::function<glm::vec3(glm::vec3, glm::vec3 noise, float amount)> &deform) {
    const rt_embree::DeviceHandle device(rtcNewDevice("threads=2,set_affinity=0"));
    std::vector<glm::vec3> positions = mesh.positions;
    positions.reserve(positions.size() + 2); // Embree may read beyond the last vertex
    const rt_embree::MeshView view{reinterpret_cast<const std::byte *>(positions.data()),
                                   reinterpret_cast<const std::byte *>(mesh.triangles.data()), sizeof(glm::vec3),
                                   sizeof mesh.triangles[0], static_cast<std::uint32_t>(mesh.triangles.size())};
    Bvh refitted(device.get(), positions, mesh), rebuilt(device.get(), positions, mesh);
    rt_embree::BvhQuality quality;
    quality.record_build(view);
    std::printf("%s, %zu triangles\n%8s %8s %10s %10s %10s %12s %12s %22s\n", name, mesh.triangles.size(), "amount",
                "degr.", "measure ms", "refit ms", "build ms", "refit rays", "new rays", "rebuild pays off after");
    for (const float amount : amounts) {
        std::minstd_rand random(1);
        std::uniform_real_distribution<float> unit(-1, 1);
        for (std::size_t i = 0; i < positions.size(); ++i) {
            const glm::vec3 noise(unit(random), unit(random), unit(random));
            positions[i] = deform(mesh.positions[i], noise, amount);
        }
        const double refit = ms_of([&] { refitted.update(RTC_BUILD_QUALITY_REFIT); });
        const double build = ms_of([&] { rebuilt.update(RTC_BUILD_QUALITY_MEDIUM); });
        const double old_rays = median_of(5, [&] { refitted.trace(); }),
                     new_rays = median_of(5, [&] { rebuilt.trace(); });
        double degradation = 0;
        const double measuring = ms_of([&] { degradation = quality.degradation(view); });
        std::printf("%8.2f %8.2f %10.2f %10.2f %10.2f %12.2f %12.2f ", static_cast<double>(amount), degradation,
                    measuring, refit, build, old_rays, new_rays);
        if (old_rays > new_rays)
            std::printf("%15.1f frames\n", (build - refit) / (old_rays - new_rays));
        else
            std::printf("%22s\n", "-");
    }
}

} // namespace

int main() {
    TriangleMesh ball = arhost::bench::dented_ball(100'000);
    measure("random displacement of a ball", ball, {0, 0.2f, 0.5f, 1, 2, 4, 8, 16},
            [](glm::vec3 p, glm::vec3 noise, float amount) { return p + noise * amount; });
    measure("twist of a ball", ball, {0, 0.5f, 1, 2, 4, 8, 16}, [](glm::vec3 p, glm::vec3, float amount) {
        const float angle = amount * p.y / 50;
        return glm::vec3(p.x * std::cos(angle) - p.z * std::sin(angle), p.y,
                         p.x * std::sin(angle) + p.z * std::cos(angle));
    });
    measure("explosion of a ball", ball, {0, 0.1f, 0.25f, 0.5f, 1, 2}, [](glm::vec3 p, glm::vec3, float amount) {
        return p + glm::vec3(std::sin(p.y), std::sin(p.z), std::sin(p.x)) *
                       (20 * amount); // parts move in different directions
    });
}
