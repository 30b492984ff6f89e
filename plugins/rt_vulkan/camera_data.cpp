// SPDX-License-Identifier: Apache-2.0
#include "camera_data.hpp"

#include "raytracer_common/view.hpp"

#include <atomic>
#include <thread>

namespace rt_vulkan {
namespace {

using Vec3d = arhost::shading::Vec3T<double>;

} // namespace

void set_camera(const arhost_camera &camera, Frame &frame) {
    const arhost::raytracer_common::Pose pose(camera);
    arhost::raytracer_common::write(pose.eye, frame.eye);
    arhost::raytracer_common::write(pose.right, frame.world_from_camera[0]);
    arhost::raytracer_common::write(pose.down, frame.world_from_camera[1]);
    arhost::raytracer_common::write(pose.forward, frame.world_from_camera[2]);
}

RayTable make_ray_table(const arhost_intrinsics &intrinsics, bool has_slopes) {
    const arhost::shading::Lens lens(intrinsics);
    RayTable table{intrinsics.distortion == ARHOST_DISTORTION_FISHEYE ? 3u : 2u, {}};
    const std::size_t values_per_pixel = table.dimensions * (has_slopes ? 3u : 1u);
    table.values.resize(values_per_pixel * intrinsics.width * intrinsics.height);
    const auto store = [&](Vec3d d, float *to) {
        to[0] = static_cast<float>(d.x);
        to[1] = static_cast<float>(d.y);
        if (table.dimensions == 3)
            to[2] = static_cast<float>(d.z);
    };
    const auto fill = [&](double x, double y, float *to) {
        const auto centre = lens.ray({x, y});
        store(centre.value_or(Vec3d{1e30, 0, 1}), to);
        if (!has_slopes)
            return;
        const auto right = lens.ray({x + 0.5, y}), left = lens.ray({x - 0.5, y});
        const auto below = lens.ray({x, y + 0.5}), above = lens.ray({x, y - 0.5});
        if (centre && right && left && below && above) {
            store(*right - *left, to + table.dimensions);
            store(*below - *above, to + std::size_t{2} * table.dimensions);
        } else {
            to[0] = 1e30f;
        }
    };
    std::atomic<std::uint32_t> next_row = 0;
    const auto work = [&] {
        for (std::uint32_t y; (y = next_row.fetch_add(1, std::memory_order_relaxed)) < intrinsics.height;)
            for (std::uint32_t x = 0; x < intrinsics.width; ++x)
                fill(x, y, &table.values[values_per_pixel * (std::size_t{y} * intrinsics.width + x)]);
    };
    std::vector<std::jthread> threads; // joined below, before the table is returned
    for (unsigned i = 1; i < std::thread::hardware_concurrency(); ++i)
        threads.emplace_back(work);
    work();
    threads.clear();
    return table;
}

} // namespace rt_vulkan
