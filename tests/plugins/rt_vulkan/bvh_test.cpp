// SPDX-License-Identifier: Apache-2.0
#include "bvh.hpp"

#include <gtest/gtest.h>

#include <random>
#include <set>
#include <stdexcept>

namespace rt_vulkan {
namespace {

std::vector<Box> boxes_at_random(std::size_t count, float spread = 100) {
    std::mt19937 random(7);
    std::uniform_real_distribution<float> place(0, spread), size(0, 1);
    std::vector<Box> boxes;
    for (std::size_t i = 0; i < count; ++i) {
        Box box;
        for (int axis = 0; axis < 3; ++axis) {
            box.low[axis] = place(random);
            box.high[axis] = box.low[axis] + size(random);
        }
        boxes.push_back(box);
    }
    return boxes;
}

bool holds(const Node &node, const Box &box) {
    for (int axis = 0; axis < 3; ++axis)
        if (box.low[axis] < node.low[axis] || box.high[axis] > node.high[axis])
            return false;
    return true;
}

// Looks at a whole tree, and returns its depth.
int walk(const Tree &tree, std::span<const Box> boxes, std::uint32_t max_leaf_size, std::set<std::uint32_t> &found,
         std::uint32_t at = 0) {
    const Node &node = tree.nodes[at];
    if (node.count) {
        EXPECT_LE(node.count, max_leaf_size);
        for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
            EXPECT_TRUE(found.insert(tree.order[i]).second) << "twice";
            EXPECT_TRUE(holds(node, boxes[tree.order[i]]));
        }
        return 0;
    }
    EXPECT_GT(node.first, at) << "children come after their parents";
    int depth = 0;
    for (const std::uint32_t child : {node.first, node.first + 1}) {
        Box box;
        std::copy_n(tree.nodes[child].low, 3, box.low);
        std::copy_n(tree.nodes[child].high, 3, box.high);
        EXPECT_TRUE(holds(node, box));
        depth = std::max(depth, walk(tree, boxes, max_leaf_size, found, child));
    }
    return depth + 1;
}

void expect_sound(const Tree &tree, std::span<const Box> boxes, std::uint32_t max_leaf_size, int max_depth) {
    std::set<std::uint32_t> found;
    EXPECT_LE(walk(tree, boxes, max_leaf_size, found), max_depth);
    EXPECT_EQ(found.size(), boxes.size());
    EXPECT_LE(tree.nodes.size(), 2 * boxes.size());
}

const auto nobody_looks = [] {};

} // namespace

TEST(Tree, HoldsEachBoxOnceWithinItsNodes) {
    for (const std::size_t count : {1, 2, 3, 5, 100, 5000}) {
        const auto boxes = boxes_at_random(count);
        expect_sound(build_tree(boxes, 4, object_depth, nobody_looks), boxes, 4, object_depth);
        expect_sound(build_tree(boxes, 1, top_depth, nobody_looks), boxes, 1, top_depth);
    }
}

TEST(Tree, IsNeverDeeperThanAsked) {
    // Each box twice as far out as the one before: by area, leaves would be split off one by one.
    std::vector<Box> boxes;
    float at = 1;
    for (int i = 0; i < 100; ++i, at *= 1.8f)
        boxes.push_back({{at, 0, 0}, {at * 1.1f, 1, 1}});
    for (const int depth : {7, 8, 12, 40})
        expect_sound(build_tree(boxes, 1, depth, nobody_looks), boxes, 1, depth);
}

TEST(Tree, SplitsBoxesThatCoincide) {
    const std::vector<Box> boxes(1000, Box{{1, 2, 3}, {4, 5, 6}});
    expect_sound(build_tree(boxes, 4, object_depth, nobody_looks), boxes, 4, object_depth);
}

TEST(Tree, IsBetterThanOneAlongTheList) {
    const auto boxes = boxes_at_random(2000);
    Tree built = build_tree(boxes, 4, object_depth, nobody_looks), shuffled = built;
    std::shuffle(shuffled.order.begin(), shuffled.order.end(), std::mt19937(3));
    refit(shuffled, boxes);
    EXPECT_LT(5 * relative_area(built), relative_area(shuffled));
}

TEST(Tree, RefitsRoundWhatMoved) {
    auto boxes = boxes_at_random(500);
    Tree tree = build_tree(boxes, 4, object_depth, nobody_looks);
    for (std::size_t i = 0; i < boxes.size(); ++i)
        for (float *corner : {boxes[i].low, boxes[i].high})
            corner[i % 3] += 50;
    refit(tree, boxes);
    expect_sound(tree, boxes, 4, object_depth);
}

TEST(Tree, CanBeCancelled) {
    const auto boxes = boxes_at_random(300000);
    EXPECT_THROW(build_tree(boxes, 4, object_depth, [] { throw std::runtime_error("enough"); }), std::runtime_error);
}

} // namespace rt_vulkan
