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
    float alpha_cutoff = 0; // 0: no holes
    const Texture *colour = nullptr;
    Object shape{}; // of it only texture coordinates and indices

    bool is_needed() const { return is_catcher || alpha_cutoff > 0; }
    bool operator==(const HitFilter &other) const {
        return is_catcher == other.is_catcher && alpha_cutoff == other.alpha_cutoff && colour == other.colour;
    }
};

HitFilter hit_filter_of(const Object &object, const Texture *textures);

// `filter` outlives the geometry.
void set_hit_filter(RTCGeometry geometry, const HitFilter &filter);

// Between the four texels round (u, v), as the kernel's sample_texture.
float sampled_alpha(const Texture &texture, float u, float v);

} // namespace rt_embree
