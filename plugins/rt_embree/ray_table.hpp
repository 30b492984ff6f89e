// SPDX-License-Identifier: Apache-2.0
//
// The ray direction of each pixel, with the lens distortion undone; computed once from the intrinsics.
#pragma once

#include "kernel.hpp"
#include "thread_pool.hpp"

#include <arhost/camera.h>
#include <arhost/shading/lens.hpp>

#include <vector>

namespace rt_embree {

// Bounding rectangle of a tile or a bounding box on the plane z = 1 in camera axes.
struct Window {
    double x0, y0, x1, y1;
    bool unbounded; // extends behind the camera: no rectangle on that plane contains it

    bool intersects(const Window &other) const {
        return unbounded || other.unbounded || (x0 <= other.x1 && other.x0 <= x1 && y0 <= other.y1 && other.y0 <= y1);
    }
};

class RayTable {
public:
    RayTable(const arhost_intrinsics &intrinsics, bool has_derivatives, ThreadPool &threads);

    Rays rays() const { return {blocks_.data(), dimensions_, has_derivatives_}; }
    const std::vector<Tile> &tiles() const { return tiles_; }
    // Of a tile; empty (x1 < x0) if none of its pixels has a ray.
    const Window &window(std::size_t tile) const { return windows_[tile]; }

    // The direction at a pixel's centre; x is NaN if the pixel has no ray.
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
