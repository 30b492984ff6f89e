// SPDX-License-Identifier: Apache-2.0
//
// Which hits do not count: where a colour texture's alpha is below its material's cut-off there is nothing, and
// primary rays pass through catchers from behind. Embree asks at each hit.
#pragma once

#include "kernel.hpp"

namespace rt_embree {

// What Embree's callbacks are given of a geometry. The pointers live as long as the geometry.
struct HitFilter {
    bool is_catcher = false;
    float alpha_cutoff = 0; // 0: no holes, and what follows is NULL
    const Texture *colour = nullptr;
    const int *indices = nullptr;
    const float *texcoords = nullptr;
    std::uint32_t index_stride = 0, texcoord_stride = 0;

    bool is_needed() const { return is_catcher || alpha_cutoff > 0; }
    bool operator==(const HitFilter &) const = default;
};

HitFilter hit_filter_of(const Object &object, const Texture *textures);

// `filter` outlives the geometry.
void set_hit_filter(RTCGeometry geometry, const HitFilter &filter);

} // namespace rt_embree
