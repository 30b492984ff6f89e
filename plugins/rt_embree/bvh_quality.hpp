// SPDX-License-Identifier: Apache-2.0
//
// Estimates how much the BVH of a deforming mesh has degraded. A refit updates the BVH's boxes but keeps its
// topology, so the BVH gets worse as triangles move apart.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace rt_embree {

// The triangles of a mesh. Strides are in bytes.
struct MeshView {
    const std::byte *positions, *triangles;
    std::uint32_t position_stride, triangle_stride, triangle_count;
};

// The traversal cost of a BVH is proportional to the area of its boxes (SAH; MacDonald and Booth, Heuristics for Ray
// Tracing Using Space Subdivision, 1990). Embree does not expose its boxes. Therefore this class groups neighbouring
// triangles itself, once at each build and once for the current positions, and compares the areas of the groups'
// bounding boxes. It uses a sample of about a thousand triangles, so its run time does not depend on the mesh size.
class BvhQuality {
public:
    // Call when the BVH is built: groups the triangles by their current positions.
    void record_build(const MeshView &mesh);
    // Returns the total box area of the groups recorded at the last build, divided by that of newly formed groups.
    // The result is about 1 if the mesh has not changed.
    double degradation(const MeshView &mesh) const;

private:
    std::vector<std::uint32_t> order_; // the sampled triangles, in their order along a Morton curve at the last build
};

} // namespace rt_embree
