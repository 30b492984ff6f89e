// SPDX-License-Identifier: Apache-2.0
//
// Trees of boxes for the plain path.
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

// Children have higher numbers than their parents. Numbers count from the tree's own first node and first primitive.
struct Tree {
    std::vector<Node> nodes;          // at most twice as many as boxes
    std::vector<std::uint32_t> order; // of the boxes, leaf by leaf
};

// Bounds on a tree's depth, which together fit the shader's stack (trace_plain.glsl).
inline constexpr int top_depth = 22, object_depth = 40;

// By binned surface area (I. Wald, On fast Construction of SAH-based Bounding Volume Hierarchies, 2007). `boxes` is
// not empty. Calls `check_cancelled` now and then, which may throw.
Tree build_tree(std::span<const Box> boxes, std::uint32_t max_leaf_size, int max_depth,
                const std::function<void()> &check_cancelled);

// Brings the nodes round boxes that have moved, without a change of their shape.
void refit(Tree &tree, std::span<const Box> boxes);

// The area of all nodes by the root's: what rays pay for them.
double relative_area(const Tree &tree);

} // namespace rt_vulkan
