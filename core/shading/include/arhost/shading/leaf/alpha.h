// SPDX-License-Identifier: Apache-2.0
// Alpha classes (arhost/raytracer.h): what lies over the video, and how much of it.
// A leaf file: see ../scalar.hpp.
//
//   a ray that hits nothing, an occluder, a catcher in the light    0
//   a catcher shadowed by something translucent                    77   0.3
//   a catcher shadowed by something opaque                        153   0.6
//   a virtual object                                              255   1

// The part of the irradiance that lights would give which is hidden, `part` and `whole` being sums over the lights:
// 1 exactly where all of it is. No light that could be hidden: none is.
ARHOST_LEAF Float share_of_light(Float part, Float whole) {
    return select(whole > Float(0.0), part / max(whole, Float(1e-30)), Float(0.0));
}

// A catcher's alpha, by the shares of light that opaque and that translucent objects hide. Where one share is 1 it is
// that class's alpha to the last bit, as its code must be.
ARHOST_LEAF Float shadow_alpha(Float opaque_share, Float translucent_share, Float alpha_opaque,
                               Float alpha_translucent) {
    return opaque_share * alpha_opaque + translucent_share * alpha_translucent;
}

// The encoded colour that makes up for what a catcher's common alpha takes too much of a channel whose own would be
// `own`, over a video of middle grey.
ARHOST_LEAF Float shadow_colour_encoded(Float own, Float alpha) {
    return (alpha - own) * (Float(0.5) / max(alpha, Float(1e-6)));
}

// 0 to 1 as an 8-bit code, still as a Float: round to nearest.
ARHOST_LEAF Float code_8bit(Float value) {
    return floor(Float(255.0) * min(max(value, Float(0.0)), Float(1.0)) + Float(0.5));
}
