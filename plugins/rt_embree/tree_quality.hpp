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
// Subdivision, 1990). Embree's own boxes can't be seen, so this measures boxes of its own, round groups of
// triangles that were neighbours when the tree was built, against groups of those that are neighbours now: what a
// new tree would have. It looks at a thousand triangles or so, so that it costs little however large the mesh is.
class TreeQuality {
public:
    // Takes the triangles' present neighbourhood for that of a tree that is built now.
    void built(const MeshView &mesh);
    // How many times as large as a new tree's the groups' area has become since then; about 1 when nothing changed.
    double decay(const MeshView &mesh) const;

private:
    std::vector<std::uint32_t> order_; // of triangles, along a Morton curve
};

} // namespace rt_embree
