// SPDX-License-Identifier: Apache-2.0
// Alpha classes of the overlay (arhost/raytracer.h). A leaf file: see ../scalar.hpp.
//
//   no hit, an occluder, an unshadowed catcher      0
//   a catcher shadowed by a translucent object     77   0.3
//   a catcher shadowed by an opaque object        153   0.6
//   a virtual object                              255   1

// The hidden fraction of irradiance, from sums over the lights: exactly 1 if part == whole, 0 if there is no light.
ARHOST_LEAF Float fraction_of_light(Float part, Float whole) {
    return select(whole > Float(0.0), part / max(whole, Float(1e-30)), Float(0.0));
}

// A catcher's alpha, from the fractions of light blocked by opaque and by translucent objects. If a fraction is 1,
// the result is bit-exactly that class's alpha.
ARHOST_LEAF Float shadow_alpha(Float opaque_fraction, Float translucent_fraction, Float alpha_opaque,
                               Float alpha_translucent) {
    return opaque_fraction * alpha_opaque + translucent_fraction * alpha_translucent;
}

// sRGB-encoded colour of a shadow with the common `alpha` for a channel whose own alpha would be `channel_alpha`:
// compensates the difference exactly over mid-grey video.
ARHOST_LEAF Float shadow_colour_encoded(Float channel_alpha, Float alpha) {
    return (alpha - channel_alpha) * (Float(0.5) / max(alpha, Float(1e-6)));
}

// [0, 1] to an 8-bit code, as a Float: round to nearest.
ARHOST_LEAF Float code_8bit(Float value) {
    return floor(Float(255.0) * min(max(value, Float(0.0)), Float(1.0)) + Float(0.5));
}
