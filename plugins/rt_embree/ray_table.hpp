// SPDX-License-Identifier: Apache-2.0
//
// Where each pixel looks: computed once from the intrinsics, the lens' distortion undone.
#pragma once

#include "kernel.hpp"
#include "thread_pool.hpp"

#include <arhost/camera.h>
#include <arhost/shading/lens.hpp>

#include <vector>

namespace rt_embree {

// The part of the plane z = 1 that a tile, or an object's box, covers as the camera sees it.
struct Window {
    double x0, y0, x1, y1;
    bool everything; // reaches behind the camera, so that no rectangle on that plane holds it

    bool meets(const Window &other) const {
        return everything || other.everything ||
               (x0 <= other.x1 && other.x0 <= x1 && y0 <= other.y1 && other.y0 <= y1);
    }
};

class RayTable {
public:
    RayTable(const arhost_intrinsics &intrinsics, bool has_slopes, ThreadPool &threads);

    Rays rays() const { return {blocks_.data(), dimensions_, has_slopes_}; }
    const std::vector<Tile> &tiles() const { return tiles_; }
    // Of a tile; empty (x1 < x0) where the lens sees nothing in it.
    const Window &window(std::size_t tile) const { return windows_[tile]; }

    // The direction at a pixel's centre; x is NaN where the lens sees nothing.
    arhost::shading::Vec3T<float> direction(std::int32_t x, std::int32_t y) const;

private:
    void fill(std::size_t tile, const arhost::shading::Lens &lens);

    std::int32_t tiles_across_, dimensions_;
    bool has_slopes_;
    std::vector<float> blocks_;
    std::vector<Tile> tiles_;
    std::vector<Window> windows_;
};

} // namespace rt_embree
