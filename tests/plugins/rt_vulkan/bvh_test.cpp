// SPDX-License-Identifier: Apache-2.0
#include "bvh.hpp"

#include <gtest/gtest.h>

#include <random>
#include <set>
#include <stdexcept>

namespace rt_vulkan {
namespace {

std::vector<Box> random_boxes(std::size_t count, float spread = 100) {
    std::mt19937 random(7);
    std::uniform_real_distribution<float> position(0, spread), size(0, 1);
    std::vector<Box> boxes;
    for (std::size_t i = 0; i < count; ++i) {
        Box box;
        for (int axis = 0; axis < 3; ++axis) {
            box.low[axis] = position(random);
            box.high[axis] = box.low[axis] + size(random);
        }
        boxes.push_back(box);
    }
    return boxes;
}

bool contains(const Node &node, const Box &box) {
    for (int axis = 0; axis < 3; ++axis)
        if (box.low[axis] < node.low[axis] || box.high[axis] > node.high[axis])
            return false;
    return true;
}

// Checks the subtree below the node `at`, adds its boxes to `found`, and returns its depth.
int check_node(const Bvh &bvh, std::span<const Box> boxes, std::uint32_t max_leaf_size,
               std::set<std::uint32_t> &found, std::uint32_t at = 0) {
    const Node &node = bvh.nodes[at];
    if (node.count) {
        EXPECT_LE(node.count, max_leaf_size);
        for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
            EXPECT_TRUE(found.insert(bvh.order[i]).second) << "box " << bvh.order[i] << " is in two leaves";
            EXPECT_TRUE(contains(node, boxes[bvh.order[i]]));
        }
        return 0;
    }
    EXPECT_GT(node.first, at) << "a child must come after its parent";
    int depth = 0;
    for (const std::uint32_t child : {node.first, node.first + 1}) {
        Box box;
        std::copy_n(bvh.nodes[child].low, 3, box.low);
        std::copy_n(bvh.nodes[child].high, 3, box.high);
        EXPECT_TRUE(contains(node, box));
        depth = std::max(depth, check_node(bvh, boxes, max_leaf_size, found, child));
    }
    return depth + 1;
}

void expect_valid(const Bvh &bvh, std::span<const Box> boxes, std::uint32_t max_leaf_size, int max_depth) {
    std::set<std::uint32_t> found;
    EXPECT_LE(check_node(bvh, boxes, max_leaf_size, found), max_depth);
    EXPECT_EQ(found.size(), boxes.size());
    EXPECT_LE(bvh.nodes.size(), 2 * boxes.size());
}

const auto never_cancelled = [] {};

} // namespace

TEST(Bvh, ContainsEachBoxOnceWithinItsNodes) {
    for (const std::size_t count : {1, 2, 3, 5, 100, 5000}) {
        const auto boxes = random_boxes(count);
        expect_valid(build_bvh(boxes, 4, max_mesh_depth, never_cancelled), boxes, 4, max_mesh_depth);
        expect_valid(build_bvh(boxes, 1, max_top_depth, never_cancelled), boxes, 1, max_top_depth);
    }
}

TEST(Bvh, RespectsTheDepthLimit) {
    // The boxes are spaced exponentially. Without a depth limit, the SAH would separate them one by one, which gives
    // a very deep BVH.
    std::vector<Box> boxes;
    float at = 1;
    for (int i = 0; i < 100; ++i, at *= 1.8f)
        boxes.push_back({{at, 0, 0}, {at * 1.1f, 1, 1}});
    for (const int depth : {7, 8, 12, 40})
        expect_valid(build_bvh(boxes, 1, depth, never_cancelled), boxes, 1, depth);
}

TEST(Bvh, SplitsCoincidentBoxes) {
    const std::vector<Box> boxes(1000, Box{{1, 2, 3}, {4, 5, 6}});
    expect_valid(build_bvh(boxes, 4, max_mesh_depth, never_cancelled), boxes, 4, max_mesh_depth);
}

TEST(Bvh, CostsLessThanARandomOrder) {
    const auto boxes = random_boxes(2000);
    Bvh built = build_bvh(boxes, 4, max_mesh_depth, never_cancelled), shuffled = built;
    std::shuffle(shuffled.order.begin(), shuffled.order.end(), std::mt19937(3));
    refit(shuffled, boxes);
    EXPECT_LT(5 * sah_cost(built), sah_cost(shuffled));
}

TEST(Bvh, RefitsToMovedBoxes) {
    auto boxes = random_boxes(500);
    Bvh bvh = build_bvh(boxes, 4, max_mesh_depth, never_cancelled);
    for (std::size_t i = 0; i < boxes.size(); ++i)
        for (float *corner : {boxes[i].low, boxes[i].high})
            corner[i % 3] += 50;
    refit(bvh, boxes);
    expect_valid(bvh, boxes, 4, max_mesh_depth);
}

TEST(Bvh, BuildCanBeCancelled) {
    const auto boxes = random_boxes(300000);
    EXPECT_THROW(build_bvh(boxes, 4, max_mesh_depth, [] { throw std::runtime_error("cancelled"); }),
                 std::runtime_error);
}

} // namespace rt_vulkan
