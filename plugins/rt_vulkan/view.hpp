// SPDX-License-Identifier: Apache-2.0
//
// The camera as the shaders read it: its axes in the world, and where each pixel looks.
#pragma once

#include "layout.hpp"

#include <arhost-cpp/plugin.hpp>

#include <vector>

namespace rt_vulkan {

// Writes the frame's eye and axes.
void look(const arhost_camera &camera, Frame &frame);

// Each pixel's direction in the camera's axes (x right, y down, z forward), row by row, z only where it is not 1
// throughout; with `has_slopes`, then what it gains along rows and along columns, per px. x is 1e30 where the lens
// sees nothing.
struct RayTable {
    std::uint32_t dimensions; // 2 or 3
    std::vector<float> numbers;
};
RayTable make_ray_table(const arhost_intrinsics &intrinsics, bool has_slopes);

} // namespace rt_vulkan
