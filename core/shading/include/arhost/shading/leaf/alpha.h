// SPDX-License-Identifier: Apache-2.0
// Alpha classes (arhost/raytracer.h): what lies over the video, and how much of it.
// A leaf file: see ../scalar.hpp.
//
//   a ray that hits nothing, an occluder, a catcher in the light    0
//   a catcher shadowed by something translucent                    77   0.3
//   a catcher shadowed by something opaque                        153   0.6
//   a virtual object                                              255   1

// The alpha that one light's shadow gives a catcher. The stronger wins where both fall.
ARHOST_LEAF Float shadow_alpha(Bool behind_opaque, Bool behind_translucent, Float alpha_opaque,
                               Float alpha_translucent) {
    return max(select(behind_opaque, alpha_opaque, Float(0.0)),
               select(behind_translucent, alpha_translucent, Float(0.0)));
}

// Several lights: each one's alpha weighted by the irradiance that it would give, `weighted_alpha` and
// `irradiance` being the sums over the lights. No light that could be hidden: no shadow.
ARHOST_LEAF Float mean_shadow_alpha(Float weighted_alpha, Float irradiance) {
    return select(irradiance > Float(0.0), weighted_alpha / max(irradiance, Float(1e-30)), Float(0.0));
}

// 0 to 1 as an 8-bit code, still as a Float: round to nearest.
ARHOST_LEAF Float code_8bit(Float value) {
    return floor(Float(255.0) * min(max(value, Float(0.0)), Float(1.0)) + Float(0.5));
}
