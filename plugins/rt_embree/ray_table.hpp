// SPDX-License-Identifier: Apache-2.0
//
// The ray direction of each pixel, corrected for lens distortion. Computed once from the camera intrinsics.
#pragma once

#include "kernel.hpp"
#include "raytracer_common/thread_pool.hpp"

#include <arhost/camera.h>
#include <arhost/shading/lens.hpp>

#include <vector>

namespace rt_embree {

// The bounding rectangle of the projection of a tile, or of a 3D bounding box, onto the plane z = 1 in camera axes.
struct Window {
    double x0, y0, x1, y1;
    bool unbounded; // part of the tile or box is behind the camera, so its projection is unbounded

    bool intersects(const Window &other) const {
        return unbounded || other.unbounded || (x0 <= other.x1 && other.x0 <= x1 && y0 <= other.y1 && other.y0 <= y1);
    }
};

class RayTable {
public:
    RayTable(const arhost_intrinsics &intrinsics, bool has_derivatives, ThreadPool &threads);

    Rays rays() const { return {blocks_.data(), dimensions_, has_derivatives_}; }
    const std::vector<Tile> &tiles() const { return tiles_; }
    // The window of a tile. It is empty (x1 < x0) if no pixel of the tile has a ray.
    const Window &window(std::size_t tile) const { return windows_[tile]; }

    // Returns the ray direction at a pixel's centre. x is NaN if the pixel has no ray.
    arhost::shading::Vec3T<float> direction(std::int32_t x, std::int32_t y) const;

private:
    void fill(std::size_t tile, const arhost::shading::Lens &lens);

    std::int32_t tiles_across_, dimensions_;
    bool has_derivatives_;
    std::vector<float> blocks_;
    std::vector<Tile> tiles_;
    std::vector<Window> windows_;
};

} // namespace rt_embree
