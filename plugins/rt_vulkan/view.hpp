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

// Where in its pixel a sample lies, from the centre: −½ to ½.
struct Sample {
    float x, y;
};
// One in each of `count` rows and columns of the pixel (N-rooks), the columns in the order of the base-2 radical
// inverse; a single one lies at the centre. The same in every pixel and frame, and as rt_embree's.
std::vector<Sample> sample_positions(std::uint32_t count);
// `count` of a sequence without end that is even over the pixel, from its number `first` (R2, as in random.glsl).
std::vector<Sample> sample_positions(std::uint32_t first, std::uint32_t count);

} // namespace rt_vulkan
