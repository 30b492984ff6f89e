// SPDX-License-Identifier: Apache-2.0
// Environment maps in equirectangular projection (arhost_environment of arhost/scene.h): u and v range from 0 to 1
// across the image; y is up. A leaf file: see ../scalar.hpp.

// Polar angle, in half turns, of a unit direction whose y component is `y`: 0 is up, 1 is down.
ARHOST_LEAF Float angle_from_up(Float y) {
    return Float(2.0) * turn_of(sqrt(max(Float(1.0) - y * y, Float(0.0))), y);
}

// Image coordinates of a unit direction.
ARHOST_LEAF Float equirectangular_u(Vec3 direction) {
    return Float(0.5) + turn_of(direction.x, -direction.z);
}
ARHOST_LEAF Float equirectangular_v(Vec3 direction) {
    return angle_from_up(direction.y);
}

// Sine of the polar angle at image coordinate `v`. The lower bound keeps the density finite at the poles.
ARHOST_LEAF Float equirectangular_sine(Float v) {
    return max(sine_of_turn(v * Float(0.5)), Float(1e-4));
}

// Unit direction at image coordinates.
ARHOST_LEAF Vec3 equirectangular_direction(Float u, Float v) {
    Float sine = equirectangular_sine(v);
    Float around = u - Float(0.5);
    return vec3(sine * sine_of_turn(around), cosine_of_turn(v * Float(0.5)), -(sine * cosine_of_turn(around)));
}

// Converts a probability density over the image's unit square to a density per steradian. At the polar angle θ, the
// image covers 2π² sin θ steradians per unit of area.
ARHOST_LEAF Float equirectangular_density(Float density_in_image, Float v) {
    return density_in_image / (Float(19.7392088021787) * equirectangular_sine(v));
}
