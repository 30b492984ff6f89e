// SPDX-License-Identifier: Apache-2.0
#include "bvh.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <numeric>

namespace rt_vulkan {
namespace {

constexpr int bin_count = 16;
constexpr float traversal_cost = 1; // cost of visiting a node, relative to the cost of an intersection test

float half_area(const Box &box) {
    const float x = box.high[0] - box.low[0], y = box.high[1] - box.low[1], z = box.high[2] - box.low[2];
    return x < 0 ? 0 : x * y + y * z + z * x;
}

// Returns twice the box's centre along `axis`, which is sufficient for sorting and binning.
float centre(const Box &box, int axis) {
    return box.low[axis] + box.high[axis];
}

struct Bin {
    Box box = empty_box();
    std::uint32_t count = 0;
};

class Builder {
public:
    Builder(std::span<const Box> boxes, std::uint32_t max_leaf_size, const std::function<void()> &check_cancelled)
        : boxes_(boxes), max_leaf_size_(max_leaf_size), check_cancelled_(check_cancelled) {
        bvh_.order.resize(boxes.size());
        std::iota(bvh_.order.begin(), bvh_.order.end(), 0u);
        bvh_.nodes.reserve(2 * boxes.size());
        bvh_.nodes.emplace_back();
    }

    Bvh build(int max_depth) {
        struct Task {
            std::uint32_t node, first, count;
            int depth; // maximum number of levels below this node
        };
        std::vector<Task> tasks{{0, 0, static_cast<std::uint32_t>(boxes_.size()), max_depth}};
        std::uint32_t since_check = 0;
        while (!tasks.empty()) {
            const Task task = tasks.back();
            tasks.pop_back();
            if ((since_check += task.count) > 1u << 20) {
                check_cancelled_();
                since_check = 0;
            }
            Box box = empty_box();
            for (std::uint32_t i = 0; i < task.count; ++i)
                include(box, boxes_[bvh_.order[task.first + i]]);
            const std::uint32_t left = split(task.first, task.count, task.depth, box);
            Node &node = bvh_.nodes[task.node];
            std::copy_n(box.low, 3, node.low);
            std::copy_n(box.high, 3, node.high);
            node.first = left ? static_cast<std::uint32_t>(bvh_.nodes.size()) : task.first;
            node.count = left ? 0 : task.count;
            if (!left)
                continue;
            tasks.push_back({node.first, task.first, left, task.depth - 1});
            tasks.push_back({node.first + 1, task.first + left, task.count - left, task.depth - 1});
            bvh_.nodes.emplace_back();
            bvh_.nodes.emplace_back();
        }
        return std::move(bvh_);
    }

private:
    // Partitions the boxes of a node. Returns the number of boxes in the left child, or 0 if the node is to be a
    // leaf.
    std::uint32_t split(std::uint32_t first, std::uint32_t count, int depth, const Box &box) {
        if (count <= 1)
            return 0;
        const auto begin = bvh_.order.begin() + first, end = begin + count;
        Box centres = empty_box();
        for (auto i = begin; i != end; ++i) {
            const float point[3] = {centre(boxes_[*i], 0), centre(boxes_[*i], 1), centre(boxes_[*i], 2)};
            include(centres, point);
        }
        // Splits at the median if an uneven split could make the BVH exceed the depth limit.
        const bool needs_median = static_cast<int>(std::bit_width(count - 1)) >= depth;
        float best_cost = std::numeric_limits<float>::infinity();
        int best_axis = -1, best_bin = 0;
        for (int axis = 0; axis < 3 && !needs_median; ++axis) {
            const float low = centres.low[axis], extent = centres.high[axis] - low;
            if (!(extent > 0))
                continue;
            std::array<Bin, bin_count> bins;
            for (auto i = begin; i != end; ++i) {
                Bin &bin = bins[bin_of(boxes_[*i], axis, low, extent)];
                include(bin.box, boxes_[*i]);
                ++bin.count;
            }
            std::array<float, bin_count> left_costs{};
            Bin left;
            for (int i = 0; i + 1 < bin_count; ++i) {
                include(left.box, bins[i].box);
                left.count += bins[i].count;
                left_costs[i] = half_area(left.box) * static_cast<float>(left.count);
            }
            Bin right;
            for (int i = bin_count - 1; i > 0; --i) {
                include(right.box, bins[i].box);
                right.count += bins[i].count;
                const float cost = left_costs[i - 1] + half_area(right.box) * static_cast<float>(right.count);
                if (right.count < count && right.count > 0 && cost < best_cost) {
                    best_cost = cost;
                    best_axis = axis;
                    best_bin = i;
                }
            }
        }
        const float area = half_area(box);
        if (count <= max_leaf_size_ &&
            !(best_axis >= 0 && best_cost + traversal_cost * area < area * static_cast<float>(count)))
            return 0;
        if (best_axis >= 0) {
            const float low = centres.low[best_axis], extent = centres.high[best_axis] - low;
            const auto right = std::partition(begin, end, [&](std::uint32_t i) {
                return bin_of(boxes_[i], best_axis, low, extent) < static_cast<std::size_t>(best_bin);
            });
            return static_cast<std::uint32_t>(right - begin);
        }
        int longest = 0;
        for (int axis = 1; axis < 3; ++axis)
            if (centres.high[axis] - centres.low[axis] > centres.high[longest] - centres.low[longest])
                longest = axis;
        std::nth_element(begin, begin + count / 2, end, [&](std::uint32_t a, std::uint32_t b) {
            return centre(boxes_[a], longest) < centre(boxes_[b], longest);
        });
        return count / 2;
    }

    static std::size_t bin_of(const Box &box, int axis, float low, float extent) {
        const float position = (centre(box, axis) - low) / extent * bin_count;
        return std::min<std::size_t>(static_cast<std::size_t>(position), bin_count - 1);
    }

    std::span<const Box> boxes_;
    std::uint32_t max_leaf_size_;
    const std::function<void()> &check_cancelled_;
    Bvh bvh_;
};

} // namespace

Box empty_box() {
    constexpr float infinity = std::numeric_limits<float>::infinity();
    return {{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
}

void include(Box &box, const float *point) {
    for (int axis = 0; axis < 3; ++axis) {
        box.low[axis] = std::min(box.low[axis], point[axis]);
        box.high[axis] = std::max(box.high[axis], point[axis]);
    }
}

void include(Box &box, const Box &other) {
    include(box, other.low);
    include(box, other.high);
}

Bvh build_bvh(std::span<const Box> boxes, std::uint32_t max_leaf_size, int max_depth,
              const std::function<void()> &check_cancelled) {
    return Builder(boxes, max_leaf_size, check_cancelled).build(max_depth);
}

void refit(Bvh &bvh, std::span<const Box> boxes) {
    for (auto node = bvh.nodes.rbegin(); node != bvh.nodes.rend(); ++node) {
        Box box = empty_box();
        for (std::uint32_t i = 0; i < node->count; ++i)
            include(box, boxes[bvh.order[node->first + i]]);
        if (node->count == 0)
            for (const std::uint32_t child : {node->first, node->first + 1}) {
                include(box, bvh.nodes[child].low);
                include(box, bvh.nodes[child].high);
            }
        std::copy_n(box.low, 3, node->low);
        std::copy_n(box.high, 3, node->high);
    }
}

double sah_cost(const Bvh &bvh) {
    double sum = 0;
    for (const Node &node : bvh.nodes) {
        Box box;
        std::copy_n(node.low, 3, box.low);
        std::copy_n(node.high, 3, box.high);
        sum += half_area(box);
    }
    Box root;
    std::copy_n(bvh.nodes[0].low, 3, root.low);
    std::copy_n(bvh.nodes[0].high, 3, root.high);
    return half_area(root) > 0 ? sum / half_area(root) : 1;
}

} // namespace rt_vulkan
