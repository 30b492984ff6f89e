// SPDX-License-Identifier: Apache-2.0
//
// Embree filter callback. Rejects hits where the colour texture's alpha is below the material's cutoff, and primary
// rays' hits on the back faces of catchers.
#pragma once

#include "kernel.hpp"

namespace rt_embree {

// User data of a geometry. The pointers must outlive the geometry.
struct HitFilter {
    bool is_catcher = false;
    float alpha_cutoff = 0; // 0: no alpha test; the pointers below are NULL
    const Texture *colour = nullptr;
    const int *indices = nullptr;
    const float *texcoords = nullptr;
    std::uint32_t index_stride = 0, texcoord_stride = 0;

    bool is_needed() const { return is_catcher || alpha_cutoff > 0; }
    bool operator==(const HitFilter &) const = default;
};

HitFilter hit_filter_of(const Object &object, const Texture *textures);

// `filter` must outlive the geometry.
void set_hit_filter(RTCGeometry geometry, const HitFilter &filter);

} // namespace rt_embree
