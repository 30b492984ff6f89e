// SPDX-License-Identifier: Apache-2.0
// Lights. A leaf file: see ../scalar.hpp.

// What of a point light's intensity arrives per unit of area that faces it: everything at any distance,
// or 1/d² of it (the inverse-square law, d in mm). The floor of 1 µm keeps it finite at the light itself.
ARHOST_LEAF Float point_light_falloff(Bool inverse_square, Float distance_squared) {
    return select(inverse_square, Float(1.0) / max(distance_squared, Float(1e-6)), Float(1.0));
}

// The share of a spot light's intensity that leaves it at an angle of this cosine: all within the inner cone,
// nothing outside the outer one, a cubic between.
ARHOST_LEAF Float spot_share(Float cosine, Float cosine_inner, Float cosine_outer) {
    Float t =
        min(max((cosine - cosine_outer) / max(cosine_inner - cosine_outer, Float(1e-6)), Float(0.0)), Float(1.0));
    return t * t * (Float(3.0) - Float(2.0) * t);
}

// The share of light that passes a surface of glass on its way from a lamp: all that Schlick's term with the
// complement of `attenuation` at a right angle does not reflect (the dissertation's coloured shadows).
ARHOST_LEAF Vec3 glass_shadow(Vec3 attenuation, Float cosine) {
    Vec3 held = schlick(vec3(Float(1.0), Float(1.0), Float(1.0)) - attenuation, cosine);
    return vec3(Float(1.0), Float(1.0), Float(1.0)) - held;
}

// The irradiance, per unit of what comes from there, that a direction stands for which was chosen with this density
// per steradian. Lambert's 1/π is in it, as in a lamp's intensity.
ARHOST_LEAF Float irradiance_of_density(Float density) {
    return Float(1.0) / max(density * Float(3.14159265358979), Float(1e-12));
}
