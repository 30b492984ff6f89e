// SPDX-License-Identifier: Apache-2.0
//
// The filter callback that Embree calls for each hit. It rejects hits where the alpha of the colour texture is below
// the material's cutoff, and hits on back faces of catchers if the query culls them (Query::cull_catcher_back_faces).
#pragma once

#include "kernel.hpp"

namespace rt_embree {

// The callback's data for one geometry. The pointers must stay valid as long as the geometry exists.
struct HitFilter {
    bool is_catcher = false;
    float alpha_cutoff = 0; // 0: no alpha test, and the pointers below are NULL
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
