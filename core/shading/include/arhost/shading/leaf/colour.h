// SPDX-License-Identifier: Apache-2.0
// Colour. A leaf file: see ../scalar.hpp.

// sRGB transfer function; input and output are in [0, 1] (IEC 61966-2-1:1999).
ARHOST_LEAF Float srgb_encode(Float linear) {
    Float x = min(max(linear, Float(0.0)), Float(1.0));
    Float curve = Float(1.055) * pow(max(x, Float(0.0031308)), Float(1.0 / 2.4)) - Float(0.055);
    return select(x > Float(0.0031308), curve, Float(12.92) * x);
}

// Inverse of srgb_encode.
ARHOST_LEAF Float srgb_decode(Float encoded) {
    Float x = min(max(encoded, Float(0.0)), Float(1.0));
    Float curve = pow((max(x, Float(0.04045)) + Float(0.055)) / Float(1.055), Float(2.4));
    return select(x > Float(0.04045), curve, x / Float(12.92));
}

// Radiance of one sample of a pixel, before averaging: 0 to 100 (100 times white). The bound keeps a single random
// ray that hits a tiny, very bright light from dominating the pixel; it darkens only highlights that are brighter.
ARHOST_LEAF Float bounded_radiance(Float radiance) {
    return min(max(radiance, Float(0.0)), Float(100.0));
}

// Luminance of a linear colour with Rec. 709 primaries (ITU-R BT.709-6, item 3.2).
ARHOST_LEAF Float luminance(Vec3 colour) {
    return colour.x * Float(0.2126) + colour.y * Float(0.7152) + colour.z * Float(0.0722);
}
