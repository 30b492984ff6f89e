// SPDX-License-Identifier: Apache-2.0
//
// Whether the tree over a mesh that deforms is still good: a refit keeps its shape and only widens its boxes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace rt_embree {

// Positions and triangles as they lie in the arena; strides in bytes.
struct MeshView {
    const std::byte *positions, *triangles;
    std::uint32_t position_stride, triangle_stride, triangle_count;
};

// What rays pay for boxes is the boxes' area (MacDonald and Booth, Heuristics for Ray Tracing Using Space
// Subdivision, 1990). Embree's own boxes can't be seen, so this measures boxes of its own: round groups of
// triangles that were neighbours when the tree was built, against the whole's.
class TreeQuality {
public:
    // Takes the triangles' present neighbourhood for that of a tree that is built now.
    void built(const MeshView &mesh);
    // How much more the groups' area has become, as a share of the whole's, since then: 1 when nothing changed.
    double decay(const MeshView &mesh) const;

private:
    double relative_area(const MeshView &mesh) const;

    std::vector<std::uint32_t> order_; // of triangles, along a Morton curve
    double area_when_built_ = 1;
};

} // namespace rt_embree
