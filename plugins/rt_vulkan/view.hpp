// SPDX-License-Identifier: Apache-2.0
//
// The camera as the shaders read it: its axes in the world, and each pixel's ray direction.
#pragma once

#include "layout.hpp"

#include <arhost-cpp/plugin.hpp>

#include <vector>

namespace rt_vulkan {

// Writes the frame's eye and axes.
void set_camera(const arhost_camera &camera, Frame &frame);

// Each pixel's direction in camera coordinates (x right, y down, z forward), row by row; z only if `dimensions` is 3,
// else it is 1. With `has_slopes`, the direction is followed by its derivatives along x and y, per px. x is 1e30 for
// pixels outside the lens's field of view.
struct RayTable {
    std::uint32_t dimensions; // 2 or 3
    std::vector<float> values;
};
RayTable make_ray_table(const arhost_intrinsics &intrinsics, bool has_slopes);

} // namespace rt_vulkan
