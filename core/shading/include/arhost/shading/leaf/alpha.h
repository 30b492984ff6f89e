// SPDX-License-Identifier: Apache-2.0
// Alpha of the overlay (arhost/raytracer.h). A leaf file: see ../scalar.hpp.
//
//   pixel                                  8-bit code   alpha
//   no hit, occluder, unshadowed catcher            0   0
//   catcher shadowed by a translucent object       77   0.3
//   catcher shadowed by an opaque object          153   0.6
//   virtual object                                255   1

// Fraction of the irradiance that is blocked. `part`: sum over the lights of the blocked irradiance; `whole`: sum of
// the irradiance without blockers. The result is exactly 1 if part == whole, and 0 if there is no light.
ARHOST_LEAF Float fraction_of_light(Float part, Float whole) {
    return select(whole > Float(0.0), part / max(whole, Float(1e-30)), Float(0.0));
}

// Alpha of a shadow catcher, from the fractions of light that opaque and translucent objects block. If one fraction
// is 1 (the other is then 0), the result is bit-exactly the corresponding alpha.
ARHOST_LEAF Float shadow_alpha(Float opaque_fraction, Float translucent_fraction, Float alpha_opaque,
                               Float alpha_translucent) {
    return opaque_fraction * alpha_opaque + translucent_fraction * alpha_translucent;
}

// One channel of the sRGB-encoded colour of a coloured shadow. All channels of a pixel share `alpha`, although the
// shadow has the alpha `channel_alpha` in this channel. The colour compensates for the difference, exactly so over
// mid-grey video.
ARHOST_LEAF Float shadow_colour_encoded(Float channel_alpha, Float alpha) {
    return (alpha - channel_alpha) * (Float(0.5) / max(alpha, Float(1e-6)));
}

// Converts a value in [0, 1] to an 8-bit code, rounded to nearest. The result is of type Float.
ARHOST_LEAF Float code_8bit(Float value) {
    return floor(Float(255.0) * min(max(value, Float(0.0)), Float(1.0)) + Float(0.5));
}
