// SPDX-License-Identifier: Apache-2.0
// Lights. A leaf file: see ../scalar.hpp.

// Irradiance per unit of a point light's intensity on a surface facing it: 1 at any distance, or 1/d² (inverse-square
// law, d in mm). The lower bound of 1 µm keeps it finite at the light.
ARHOST_LEAF Float point_light_falloff(Bool inverse_square, Float distance_squared) {
    return select(inverse_square, Float(1.0) / max(distance_squared, Float(1e-6)), Float(1.0));
}

// Relative intensity of a spot light. `cosine`: of the angle to its axis. 1 inside the inner cone, 0 outside the
// outer cone, and a smooth cubic transition in between.
ARHOST_LEAF Float spot_attenuation(Float cosine, Float cosine_inner, Float cosine_outer) {
    Float t =
        min(max((cosine - cosine_outer) / max(cosine_inner - cosine_outer, Float(1e-6)), Float(0.0)), Float(1.0));
    return t * t * (Float(3.0) - Float(2.0) * t);
}

// Transmittance of a glass surface for shadow rays: 1 − Schlick's term with f0 = 1 − attenuation (coloured shadows,
// as in the dissertation).
ARHOST_LEAF Vec3 glass_shadow(Vec3 attenuation, Float cosine) {
    Vec3 blocked = schlick(vec3(Float(1.0), Float(1.0), Float(1.0)) - attenuation, cosine);
    return vec3(Float(1.0), Float(1.0), Float(1.0)) - blocked;
}

// Irradiance that one sampled direction contributes per unit of radiance, if directions are sampled with `density`
// per steradian. Includes Lambert's 1/π, as lamp intensities do.
ARHOST_LEAF Float irradiance_of_density(Float density) {
    return Float(1.0) / max(density * Float(3.14159265358979), Float(1e-12));
}
