// SPDX-License-Identifier: Apache-2.0
//
// Computes the camera data that the shaders read: the camera's axes in world space, and each pixel's ray direction.
#pragma once

#include "layout.hpp"

#include <arhost-cpp/plugin.hpp>

#include <vector>

namespace rt_vulkan {

// Sets `eye` and `world_from_camera` of the frame.
void set_camera(const arhost_camera &camera, Frame &frame);

// The ray direction of each pixel in camera axes (x right, y down, z forward), row by row. If `dimensions` is 2, only
// x and y are stored, and z is 1. With `has_slopes`, the derivatives along image rows and image columns, per px,
// follow each direction. x is 1e30 for pixels outside the field of view of the lens.
struct RayTable {
    std::uint32_t dimensions; // 2 or 3
    std::vector<float> values;
};
RayTable make_ray_table(const arhost_intrinsics &intrinsics, bool has_slopes);

} // namespace rt_vulkan
