// SPDX-License-Identifier: Apache-2.0
//
// Bounding volume hierarchies for the plain path.
#pragma once

#include "layout.hpp"

#include <functional>
#include <span>
#include <vector>

namespace rt_vulkan {

struct Box {
    float low[3], high[3];
};
Box empty_box();
void include(Box &box, const Box &other);
void include(Box &box, const float *point);

// Indices are relative to the BVH's first node and first primitive. Children come after their parents.
struct Bvh {
    std::vector<Node> nodes;          // at most twice the number of boxes
    std::vector<std::uint32_t> order; // of the boxes, leaf by leaf
};

// Depth limits; their sum fits the shader's stack (trace_plain.glsl).
inline constexpr int max_top_depth = 22, max_mesh_depth = 40;

// Binned SAH (I. Wald, On fast Construction of SAH-based Bounding Volume Hierarchies, 2007). `boxes` must not be
// empty. Calls `check_cancelled` regularly, which may throw.
Bvh build_bvh(std::span<const Box> boxes, std::uint32_t max_leaf_size, int max_depth,
              const std::function<void()> &check_cancelled);

// Fits the nodes to moved boxes; the topology stays.
void refit(Bvh &bvh, std::span<const Box> boxes);

// SAH cost: the area of all nodes relative to the root's.
double sah_cost(const Bvh &bvh);

} // namespace rt_vulkan
