// SPDX-License-Identifier: Apache-2.0
// Lights. A leaf file: see ../scalar.hpp.

// What of a point light's intensity arrives per unit of area that faces it: everything at any distance,
// or 1/d² of it (the inverse-square law, d in mm). The floor of 1 µm keeps it finite at the light itself.
ARHOST_LEAF Float point_light_falloff(Bool inverse_square, Float distance_squared) {
    return select(inverse_square, Float(1.0) / max(distance_squared, Float(1e-6)), Float(1.0));
}
