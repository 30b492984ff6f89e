// SPDX-License-Identifier: Apache-2.0
//
// The filter callback that Embree calls for each hit. It rejects hits where the opacity is below the material's
// cutoff, hits on back faces of catchers if the query culls them (Query::cull_catcher_back_faces), and of rays of the
// eye (RayFlag) hits on hidden back faces. Other rays hit blended surfaces at random, with the chance of the opacity.
#pragma once

#include "kernel.hpp"

namespace rt_embree {

// The callback's data for one geometry. The pointers must stay valid as long as the geometry exists.
struct HitFilter {
    bool is_catcher = false, hides_back_faces = false, blends = false;
    float alpha_cutoff = 0; // 0: no alpha test
    // Only with `blends` or an alpha_cutoff:
    float opacity = 1;
    const Texture *colour = nullptr; // NULL: opaque, also if there are no texcoords
    const int *indices = nullptr;
    const float *texcoords = nullptr;       // of the set of `colour`
    const std::uint16_t *colours = nullptr; // of the vertices; may be NULL
    std::uint32_t index_stride = 0, texcoord_stride = 0, colour_stride = 0;

    bool tests_opacity() const { return blends || alpha_cutoff > 0; }
    bool is_needed() const { return is_catcher || hides_back_faces || tests_opacity(); }
    bool operator==(const HitFilter &) const = default;
};

HitFilter hit_filter_of(const Object &object, bool hides_back_faces, const Texture *textures);

// `filter` must outlive the geometry.
void set_hit_filter(RTCGeometry geometry, const HitFilter &filter);

} // namespace rt_embree
