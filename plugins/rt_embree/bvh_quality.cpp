// SPDX-License-Identifier: Apache-2.0
#include "bvh_quality.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

namespace rt_embree {
namespace {

constexpr std::size_t group_size = 16, max_samples = 1024; // numbers of triangles

struct Bounds {
    float low[3], high[3];

    Bounds() {
        std::fill_n(low, 3, std::numeric_limits<float>::max());
        std::fill_n(high, 3, std::numeric_limits<float>::lowest());
    }
    void include(const float *p) {
        for (int i = 0; i < 3; ++i) {
            low[i] = std::min(low[i], p[i]);
            high[i] = std::max(high[i], p[i]);
        }
    }
    void include(const Bounds &box) {
        include(box.low);
        include(box.high);
    }
    double half_area() const {
        const double x = high[0] - low[0], y = high[1] - low[1], z = high[2] - low[2];
        return x * y + y * z + z * x;
    }
};

Bounds bounds_of(const MeshView &mesh, std::uint32_t triangle) {
    std::uint32_t corners[3];
    std::memcpy(corners, mesh.triangles + std::size_t{mesh.triangle_stride} * triangle, sizeof corners);
    Bounds bounds;
    for (const std::uint32_t corner : corners) {
        float p[3];
        std::memcpy(p, mesh.positions + std::size_t{mesh.position_stride} * corner, sizeof p);
        bounds.include(p);
    }
    return bounds;
}

// Inserts two zeros after each of the ten bits.
std::uint32_t spread(std::uint32_t bits) {
    bits = (bits | bits << 16) & 0x030000ff;
    bits = (bits | bits << 8) & 0x0300f00f;
    bits = (bits | bits << 4) & 0x030c30c3;
    return (bits | bits << 2) & 0x09249249;
}

// Returns the indices of sampled triangles, ordered along a Morton curve.
std::vector<std::uint32_t> morton_order(const MeshView &mesh) {
    const auto stride =
        std::max<std::uint32_t>(1, static_cast<std::uint32_t>((mesh.triangle_count + max_samples - 1) / max_samples));
    std::vector<Bounds> boxes;
    Bounds all;
    for (std::uint32_t i = 0; i < mesh.triangle_count; i += stride) {
        boxes.push_back(bounds_of(mesh, i));
        all.include(boxes.back());
    }
    std::vector<std::pair<std::uint32_t, std::uint32_t>> keyed;
    for (std::uint32_t i = 0; i < boxes.size(); ++i) {
        std::uint32_t key = 0;
        for (int axis = 0; axis < 3; ++axis) {
            const float extent = all.high[axis] - all.low[axis];
            const float middle = (boxes[i].low[axis] + boxes[i].high[axis]) / 2 - all.low[axis];
            key |= spread(extent > 0 ? static_cast<std::uint32_t>(middle / extent * 1023) : 0) << axis;
        }
        keyed.emplace_back(key, i * stride);
    }
    std::sort(keyed.begin(), keyed.end());
    std::vector<std::uint32_t> order;
    order.reserve(keyed.size());
    for (const auto &[key, triangle] : keyed)
        order.push_back(triangle);
    return order;
}

// Returns half the total area of the bounding boxes of groups of `group_size` consecutive triangles in `order`.
double area_of_groups(const MeshView &mesh, const std::vector<std::uint32_t> &order) {
    double sum = 0;
    for (std::size_t first = 0; first < order.size(); first += group_size) {
        Bounds box;
        for (std::size_t i = first; i < std::min(first + group_size, order.size()); ++i)
            box.include(bounds_of(mesh, order[i]));
        sum += box.half_area();
    }
    return sum;
}

} // namespace

void BvhQuality::record_build(const MeshView &mesh) {
    order_ = morton_order(mesh);
}

double BvhQuality::degradation(const MeshView &mesh) const {
    const double current = area_of_groups(mesh, order_), rebuilt = area_of_groups(mesh, morton_order(mesh));
    return rebuilt > 0 ? current / rebuilt : 1;
}

} // namespace rt_embree
