// SPDX-License-Identifier: Apache-2.0
//
// Estimates how much a deforming mesh's BVH has degraded: a refit keeps its topology and only updates its boxes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace rt_embree {

// Strides are in bytes.
struct MeshView {
    const std::byte *positions, *triangles;
    std::uint32_t position_stride, triangle_stride, triangle_count;
};

// The traversal cost of a BVH is proportional to the area of its boxes (SAH; MacDonald and Booth, Heuristics for Ray
// Tracing Using Space Subdivision, 1990). Embree's boxes are not accessible, so this compares bounding boxes of
// groups of triangles that were neighbours at the last build with those of triangles that are neighbours now, as a
// new BVH would group them. It samples about a thousand triangles, so that the cost does not depend on the mesh size.
class BvhQuality {
public:
    // Records the current neighbourhood of triangles as that of a new BVH.
    void record_build(const MeshView &mesh);
    // Box area of the recorded groups relative to that of new groups: about 1 if nothing has changed.
    double degradation(const MeshView &mesh) const;

private:
    std::vector<std::uint32_t> order_; // sampled triangles along a Morton curve at the last build
};

} // namespace rt_embree
