// SPDX-License-Identifier: Apache-2.0
#include "view.hpp"

#include <arhost/shading/lens.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <span>
#include <thread>

namespace rt_vulkan {
namespace {

using Vec3d = arhost::shading::Vec3T<double>;

[[noreturn]] void refuse(const std::string &message) {
    throw arhost::Failure(ARHOST_ERROR_INVALID_ARGUMENT, message);
}

bool all_finite(std::span<const double> values) {
    return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
}

double radical_inverse_2(std::uint32_t i) {
    double inverse = 0;
    for (double digit = 0.5; i; i /= 2, digit /= 2)
        inverse += digit * (i % 2);
    return inverse;
}

} // namespace

void check_setup(const arhost_raytracer_setup &setup) {
    const arhost_intrinsics &in = *setup.intrinsics;
    if (setup.width < 1 || setup.height < 1 || setup.width > ARHOST_MAX_IMAGE_SIDE ||
        setup.height > ARHOST_MAX_IMAGE_SIDE)
        refuse("the image's size is not 1 to " + std::to_string(ARHOST_MAX_IMAGE_SIDE) + " px a side");
    if (in.width != setup.width || in.height != setup.height)
        refuse("the intrinsics belong to an image of another size than the one to make");
    if (!all_finite({&in.fx, 4}) || !(in.fx > 0) || !(in.fy > 0))
        refuse("the intrinsics' focal lengths are not above 0, or not finite");
    const std::uint32_t count = in.coefficient_count;
    const bool fits = in.distortion == ARHOST_DISTORTION_NONE ? count == 0
                      : in.distortion == ARHOST_DISTORTION_BROWN
                          ? count == 4 || count == 5 || count == 8 || count == 12
                      : in.distortion == ARHOST_DISTORTION_FISHEYE ? count == 4
                                                                   : false;
    if (!fits || !all_finite({in.coefficients, count}))
        refuse("the distortion's model, or the count or values of its coefficients, are not valid");
    if (setup.scene->magic != ARHOST_SCENE_MAGIC || setup.scene->version != ARHOST_SCENE_VERSION)
        refuse("the scene is not an arena of version " + std::to_string(ARHOST_SCENE_VERSION));
}

bool same_view(const arhost_camera &a, const arhost_camera &b) {
    return std::equal(a.eye, a.eye + 3, b.eye) && std::equal(a.look_at, a.look_at + 3, b.look_at) &&
           std::equal(a.up, a.up + 3, b.up);
}

bool same(const arhost_intrinsics &a, const arhost_intrinsics &b) {
    return a.width == b.width && a.height == b.height && a.distortion == b.distortion && a.fx == b.fx &&
           a.fy == b.fy && a.cx == b.cx && a.cy == b.cy && a.coefficient_count == b.coefficient_count &&
           std::equal(a.coefficients,
                      a.coefficients + std::min<std::uint32_t>(a.coefficient_count, ARHOST_MAX_DISTORTION),
                      b.coefficients);
}

void look(const arhost_camera &camera, Frame &frame) {
    if (!all_finite(camera.eye) || !all_finite(camera.look_at) || !all_finite(camera.up))
        refuse("the camera's eye, look_at or up is not finite");
    constexpr double limit_mm = 1e12; // the square of what is far beyond leaves the range of floats
    if (std::any_of(camera.eye, camera.eye + 3, [](double number) { return std::abs(number) > limit_mm; }))
        refuse("the camera's eye lies beyond 1e12 mm");
    const Vec3d eye{camera.eye[0], camera.eye[1], camera.eye[2]};
    const Vec3d w = eye - Vec3d{camera.look_at[0], camera.look_at[1], camera.look_at[2]};
    const Vec3d up{camera.up[0], camera.up[1], camera.up[2]};
    const Vec3d u = cross(up, w);
    if (!(length(w) > 0))
        refuse("the camera's look_at is its eye");
    if (!(length(u) > 1e-9 * length(up) * length(w)))
        refuse("the camera's up is parallel to its view direction");
    const Vec3d forward = w * (-1 / length(w)), right = u * (1 / length(u)), down = cross(forward, right);
    const auto put = [](Vec3d from, float *to) {
        to[0] = static_cast<float>(from.x);
        to[1] = static_cast<float>(from.y);
        to[2] = static_cast<float>(from.z);
    };
    put(eye, frame.eye);
    put(right, frame.world_from_camera[0]);
    put(down, frame.world_from_camera[1]);
    put(forward, frame.world_from_camera[2]);
}

RayTable make_ray_table(const arhost_intrinsics &intrinsics, bool has_slopes) {
    const arhost::shading::Lens lens(intrinsics);
    RayTable table{intrinsics.distortion == ARHOST_DISTORTION_FISHEYE ? 3u : 2u, {}};
    const std::size_t numbers_a_pixel = table.dimensions * (has_slopes ? 3u : 1u);
    table.numbers.resize(numbers_a_pixel * intrinsics.width * intrinsics.height);
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
                fill(x, y, &table.numbers[numbers_a_pixel * (std::size_t{y} * intrinsics.width + x)]);
    };
    std::vector<std::jthread> threads; // joined at the end: only then the table is read
    for (unsigned i = 1; i < std::thread::hardware_concurrency(); ++i)
        threads.emplace_back(work);
    work();
    threads.clear();
    return table;
}

std::vector<Sample> sample_positions(std::uint32_t count) {
    std::vector<std::uint32_t> columns(count);
    std::iota(columns.begin(), columns.end(), 0u);
    std::sort(columns.begin(), columns.end(),
              [](std::uint32_t a, std::uint32_t b) { return radical_inverse_2(a) < radical_inverse_2(b); });
    std::vector<Sample> samples;
    const auto size = static_cast<float>(count);
    for (std::uint32_t row = 0; row < count; ++row)
        samples.push_back({(static_cast<float>(columns[row]) + 0.5f) / size - 0.5f,
                           (static_cast<float>(row) + 0.5f) / size - 0.5f});
    return samples;
}

std::vector<Sample> sample_positions(std::uint32_t first, std::uint32_t count) {
    std::vector<Sample> samples;
    for (std::uint32_t i = 0; i < count; ++i) {
        const auto place = [&](std::uint32_t step) { // of turns of 2³², about 0
            return static_cast<float>(static_cast<std::int32_t>((first + i) * step)) * 0x1p-32f;
        };
        samples.push_back({place(3242174889u), place(2447445414u)});
    }
    return samples;
}

} // namespace rt_vulkan
