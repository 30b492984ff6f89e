// SPDX-License-Identifier: Apache-2.0
// Alpha of the overlay (arhost/raytracer.h). A leaf file: see ../scalar.hpp.
//
// The overlay is composited in sRGB, but a shadow hides a share of the linear light. The alpha of a partial shadow is
// therefore exact for one brightness of the video only: mid-grey, the sRGB value 0.5, whose linear light is 0.214.
//
//   pixel                                  8-bit code   alpha
//   no hit, occluder, unshadowed catcher            0   0
//   catcher shadowed by a translucent object       77   0.3
//   catcher shadowed by an opaque object          153   0.6
//   virtual object                                255   1

// `part` divided by `whole`: exactly 1 if they are equal, and 0 if `whole` is 0. For example the blocked irradiance
// divided by the irradiance without blockers.
ARHOST_LEAF Float fraction_of(Float part, Float whole) {
    Float share = select(part < whole, part / max(whole, Float(1e-30)), Float(1.0));
    return select(whole > Float(0.0), share, Float(0.0));
}

// Share of the linear light of mid-grey video that remains under a black overlay.
ARHOST_LEAF Float light_under_alpha(Float alpha) {
    return srgb_decode(Float(0.5) * (Float(1.0) - alpha)) * Float(4.67199902666847);
}

// Inverse of light_under_alpha.
ARHOST_LEAF Float alpha_of_light(Float light) {
    return max(Float(1.0) - Float(2.0) * srgb_encode(light * Float(0.214041140482232)), Float(0.0));
}

// Alpha of a shadow catcher, from the fractions of light that opaque and translucent objects hide. `alpha_opaque` and
// `alpha_translucent` are the alphas of a fully hidden light.
ARHOST_LEAF Float shadow_alpha(Float opaque_fraction, Float translucent_fraction, Float alpha_opaque,
                               Float alpha_translucent) {
    return alpha_of_light(Float(1.0) - opaque_fraction * (Float(1.0) - light_under_alpha(alpha_opaque)) -
                          translucent_fraction * (Float(1.0) - light_under_alpha(alpha_translucent)));
}

// Alpha of a straight image, from the transmittance of a linear one (arhost/raytracer.h): the mean light that it
// removes from the video.
ARHOST_LEAF Float overlay_alpha(Vec3 transmittance) {
    Float sum =
        min(transmittance.x, Float(1.0)) + min(transmittance.y, Float(1.0)) + min(transmittance.z, Float(1.0));
    return max(Float(1.0) - sum * Float(1.0 / 3.0), Float(0.0));
}

// Linear light of a straight image's colour where a linear one adds `added` and overlay_alpha is `alpha`. The pair
// approximates light that is added to catchers, which needs an alpha of 0, and coloured shadows.
ARHOST_LEAF Float overlay_colour(Float added, Float alpha) {
    return select(alpha > Float(0.0), added / max(alpha, Float(1e-9)), Float(0.0));
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
