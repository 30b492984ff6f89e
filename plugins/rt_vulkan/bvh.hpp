// SPDX-License-Identifier: Apache-2.0
//
// Software bounding volume hierarchies, for the path `plain`.
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

// A BVH. Node indices start at 0 for the root; indices in leaves refer to `order`. Children come after their parents.
struct Bvh {
    std::vector<Node> nodes;          // at most twice as many as there are boxes
    std::vector<std::uint32_t> order; // the indices of the boxes, leaf by leaf
};

// Maximum depths of the top-level BVH and of a mesh's BVH. Their sum must be below the size of the shader's stack
// (trace_plain.glsl).
inline constexpr int max_top_depth = 22, max_mesh_depth = 40;

// Builds a BVH over `boxes` with the binned SAH (I. Wald, On fast Construction of SAH-based Bounding Volume
// Hierarchies, 2007). `boxes` must not be empty. Regularly calls `check_cancelled`, which may throw.
Bvh build_bvh(std::span<const Box> boxes, std::uint32_t max_leaf_size, int max_depth,
              const std::function<void()> &check_cancelled);

// Updates the bounds of the nodes to moved `boxes`. The topology does not change.
void refit(Bvh &bvh, std::span<const Box> boxes);

// Returns the SAH cost: the total area of all nodes divided by the area of the root.
double sah_cost(const Bvh &bvh);

} // namespace rt_vulkan
