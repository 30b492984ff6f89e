// SPDX-License-Identifier: Apache-2.0
// Mappings from the unit square to points and directions. A leaf file: see ../scalar.hpp.

// Orthonormal basis around `n` (Duff et al., Building an Orthonormal Basis, Revisited, JCGT 6(1), 2017).
ARHOST_LEAF Vec3 tangent_axis(Vec3 n) {
    Float sign = select(n.z < Float(0.0), Float(-1.0), Float(1.0));
    Float a = Float(-1.0) / (sign + n.z);
    return vec3(Float(1.0) + sign * n.x * n.x * a, sign * n.x * n.y * a, -sign * n.x);
}
ARHOST_LEAF Vec3 bitangent_axis(Vec3 n) {
    Float sign = select(n.z < Float(0.0), Float(-1.0), Float(1.0));
    Float a = Float(-1.0) / (sign + n.z);
    return vec3(n.x * n.y * a, sign + n.y * n.y * a, -n.y);
}

// Density of hemisphere_direction() per steradian: 1/2π.
ARHOST_LEAF Float hemisphere_density() {
    return Float(0.159154943091895);
}

// Samples a direction of the hemisphere around `normal` uniformly.
ARHOST_LEAF Vec3 hemisphere_direction(Vec3 normal, Float u, Float v) {
    Float cosine = Float(1.0) - u;
    Float sine = sqrt(max(Float(1.0) - cosine * cosine, Float(0.0)));
    return tangent_axis(normal) * (sine * cosine_of_turn(v)) + bitangent_axis(normal) * (sine * sine_of_turn(v)) +
           normal * cosine;
}

// Samples a direction of the hemisphere around `normal` with a density proportional to the cosine: cosine / π.
ARHOST_LEAF Vec3 cosine_direction(Vec3 normal, Float u, Float v) {
    Float sine = sqrt(u);
    Float cosine = sqrt(max(Float(1.0) - u, Float(0.0)));
    return tangent_axis(normal) * (sine * cosine_of_turn(v)) + bitangent_axis(normal) * (sine * sine_of_turn(v)) +
           normal * cosine;
}

// Samples a direction of the cone around `axis` uniformly. `slope`: 1 − cosine of the half angle; the density is
// 1 / (2π · slope).
ARHOST_LEAF Vec3 cone_direction(Vec3 axis, Float slope, Float u, Float v) {
    Float below = u * slope;
    Float sine = sqrt(max(below * (Float(2.0) - below), Float(0.0)));
    return tangent_axis(axis) * (sine * cosine_of_turn(v)) + bitangent_axis(axis) * (sine * sine_of_turn(v)) +
           axis * (Float(1.0) - below);
}

// Samples the normal of a GGX microfacet that is visible from `to_eye`, in coordinates with the surface normal along
// z. `alpha_x`, `alpha_y`: along x and y (Dupuy and Benyoub, Sampling Visible GGX Normals with Spherical Caps, CGF
// 42(8), 2023, listing 1).
ARHOST_LEAF Vec3 ggx_visible_normal(Vec3 to_eye, Float alpha_x, Float alpha_y, Float u, Float v) {
    Vec3 stretched = vec3(to_eye.x * alpha_x, to_eye.y * alpha_y, to_eye.z);
    stretched = stretched * (Float(1.0) / sqrt(max(dot(stretched, stretched), Float(1e-12))));
    Float z = (Float(1.0) - v) * (Float(1.0) + stretched.z) - stretched.z;
    Float radius = sqrt(min(max(Float(1.0) - z * z, Float(0.0)), Float(1.0)));
    Vec3 half_vector = vec3(radius * cosine_of_turn(u), radius * sine_of_turn(u), z) + stretched;
    Vec3 n = vec3(half_vector.x * alpha_x, half_vector.y * alpha_y, max(half_vector.z, Float(1e-6)));
    return n * (Float(1.0) / sqrt(dot(n, n)));
}

// Like ggx_visible_normal, but in world coordinates. `x`, `y`, `normal`: axes of the surface, unit vectors.
ARHOST_LEAF Vec3 anisotropic_half_vector(Vec3 x, Vec3 y, Vec3 normal, Vec3 to_eye, Float alpha_x, Float alpha_y,
                                         Float u, Float v) {
    Vec3 local = vec3(dot(to_eye, x), dot(to_eye, y), max(dot(to_eye, normal), Float(1e-4)));
    Vec3 facet = ggx_visible_normal(local, alpha_x, alpha_y, u, v);
    return x * facet.x + y * facet.y + normal * facet.z;
}
ARHOST_LEAF Vec3 ggx_half_vector(Vec3 normal, Vec3 to_eye, Float alpha, Float u, Float v) {
    return anisotropic_half_vector(tangent_axis(normal), bitangent_axis(normal), normal, to_eye, alpha, alpha, u, v);
}

// Vector to the point (u, v) of a rectangle. `to_centre`: vector to its centre; `axis_u`, `axis_v`: half sides.
ARHOST_LEAF Vec3 vector_to_rectangle(Vec3 to_centre, Vec3 axis_u, Vec3 axis_v, Float u, Float v) {
    return to_centre + axis_u * (u * Float(2.0) - Float(1.0)) + axis_v * (v * Float(2.0) - Float(1.0));
}

// Vector to a point of the disc through the centre of a sphere. `to_centre`: vector to the centre, perpendicular to
// the disc.
ARHOST_LEAF Vec3 vector_to_disc(Vec3 to_centre, Float radius, Float u, Float v) {
    Vec3 n = normalize(to_centre);
    Float r = radius * sqrt(u);
    return to_centre + tangent_axis(n) * (r * cosine_of_turn(v)) + bitangent_axis(n) * (r * sine_of_turn(v));
}

// Relative position (0 to 1) of `value` between the cumulative sums `sum_before` and sum_before + step.
ARHOST_LEAF Float fraction_of_step(Float value, Float sum_before, Float step) {
    return min((value - sum_before) / max(step, Float(1e-12)), Float(1.0));
}
