// SPDX-License-Identifier: Apache-2.0
// Light from all round, by an image in equirectangular projection (arhost_environment of arhost/scene.h): u and v are
// 0 to 1 over it, y is up. A leaf file: see ../scalar.hpp.

// The angle of a direction of height y, in half turns: 0 up, 1 down.
ARHOST_LEAF Float angle_from_up(Float y) {
    return Float(2.0) * turn_of(sqrt(max(Float(1.0) - y * y, Float(0.0))), y);
}

// Where a direction of length 1 lies in the image.
ARHOST_LEAF Float equirectangular_u(Vec3 direction) {
    return Float(0.5) + turn_of(direction.x, -direction.z);
}
ARHOST_LEAF Float equirectangular_v(Vec3 direction) {
    return angle_from_up(direction.y);
}

// The sine of the angle from up. The floor keeps the density finite at the poles.
ARHOST_LEAF Float equirectangular_sine(Float v) {
    return max(sine_of_turn(v * Float(0.5)), Float(1e-4));
}

// The direction of a place.
ARHOST_LEAF Vec3 equirectangular_direction(Float u, Float v) {
    Float sine = equirectangular_sine(v);
    Float around = u - Float(0.5);
    return vec3(sine * sine_of_turn(around), cosine_of_turn(v * Float(0.5)), -(sine * cosine_of_turn(around)));
}

// How dense, per steradian, directions are whose places have this density over the image's unit square: the image
// shows 2π² sin θ steradians a unit.
ARHOST_LEAF Float equirectangular_density(Float density_in_image, Float v) {
    return density_in_image / (Float(19.7392088021787) * equirectangular_sine(v));
}
