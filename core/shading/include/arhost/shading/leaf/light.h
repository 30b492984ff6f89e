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

// Density per steradian of directions to points that are uniformly distributed over an area. `cosine`: of the angle
// between the direction and the area's normal.
ARHOST_LEAF Float density_over_area(Float distance_squared, Float area, Float cosine) {
    return distance_squared / max(area * cosine, Float(1e-12));
}

// Distance along a ray to a rectangle, if the ray arrives at the side that `facing` points to; else at most 0.
// `to_centre`: vector from the ray's origin to the centre; `axis_u`, `axis_v`: half sides.
ARHOST_LEAF Float distance_to_rectangle(Vec3 to_centre, Vec3 facing, Vec3 axis_u, Vec3 axis_v, Vec3 direction) {
    Float along = dot(direction, facing);
    Float distance = dot(to_centre, facing) / min(along, Float(-1e-6));
    Vec3 offset = direction * distance - to_centre;
    Float beyond =
        max(abs(dot(offset, axis_u)) - dot(axis_u, axis_u), abs(dot(offset, axis_v)) - dot(axis_v, axis_v));
    return select(along < Float(0.0), select(beyond > Float(0.0), Float(0.0), distance), Float(0.0));
}

// Distance along a ray to the disc of a sphere that faces the ray's origin (vector_to_disc in sampling.h); 0 if the
// ray misses it.
ARHOST_LEAF Float distance_to_disc(Vec3 to_centre, Float radius, Vec3 direction) {
    Float along = dot(direction, to_centre);
    Float distance = dot(to_centre, to_centre) / max(along, Float(1e-12));
    Vec3 offset = direction * distance - to_centre;
    Float beyond = dot(offset, offset) - radius * radius;
    return select(along > Float(0.0), select(beyond > Float(0.0), Float(0.0), distance), Float(0.0));
}

// Weight of a sample in multiple importance sampling with the balance heuristic (Veach and Guibas, Optimally
// Combining Sampling Techniques, SIGGRAPH 1995). Each density is multiplied by the number of samples of its
// technique. `density` = 0 means that no other technique can sample the light.
ARHOST_LEAF Float balance_weight(Float density, Float other_density) {
    return select(density > Float(0.0), density / max(density + other_density, Float(1e-30)), Float(1.0));
}

// balance_weight of a randomly reflected ray that arrives at a light. `light_density`: number of samples of the light
// times their density per steradian; `inverse_density`: reciprocal of the ray's density, 0 if the ray is not random.
ARHOST_LEAF Float balance_weight_of_ray(Float light_density, Float inverse_density) {
    return Float(1.0) / (Float(1.0) + light_density * inverse_density);
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
