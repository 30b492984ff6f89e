// SPDX-License-Identifier: Apache-2.0
// From even numbers of 0 to 1 to points and directions. A leaf file: see ../scalar.hpp.

// Two axes across `n` and each other (Duff et al., Building an Orthonormal Basis, Revisited, JCGT 6(1), 2017).
ARHOST_LEAF Vec3 first_axis_across(Vec3 n) {
    Float sign = select(n.z < Float(0.0), Float(-1.0), Float(1.0));
    Float a = Float(-1.0) / (sign + n.z);
    return vec3(Float(1.0) + sign * n.x * n.x * a, sign * n.x * n.y * a, -sign * n.x);
}
ARHOST_LEAF Vec3 second_axis_across(Vec3 n) {
    Float sign = select(n.z < Float(0.0), Float(-1.0), Float(1.0));
    Float a = Float(-1.0) / (sign + n.z);
    return vec3(n.x * n.y * a, sign + n.y * n.y * a, -n.y);
}

// A GGX microfacet's normal as it is seen from `to_eye`, in axes in which the surface's normal is z; for even
// u, v (Dupuy and Benyoub, Sampling Visible GGX Normals with Spherical Caps, CGF 42(8), 2023, listing 1).
ARHOST_LEAF Vec3 ggx_visible_normal(Vec3 to_eye, Float alpha, Float u, Float v) {
    Vec3 stretched = vec3(to_eye.x * alpha, to_eye.y * alpha, to_eye.z);
    stretched = stretched * (Float(1.0) / sqrt(max(dot(stretched, stretched), Float(1e-12))));
    Float z = (Float(1.0) - v) * (Float(1.0) + stretched.z) - stretched.z;
    Float radius = sqrt(min(max(Float(1.0) - z * z, Float(0.0)), Float(1.0)));
    Vec3 half_way = vec3(radius * cosine_of_turn(u), radius * sine_of_turn(u), z) + stretched;
    Vec3 n = vec3(half_way.x * alpha, half_way.y * alpha, max(half_way.z, Float(1e-6)));
    return n * (Float(1.0) / sqrt(dot(n, n)));
}

// The same for any normal of length 1, in the world's axes: what `to_eye` is reflected by.
ARHOST_LEAF Vec3 ggx_half_way(Vec3 normal, Vec3 to_eye, Float alpha, Float u, Float v) {
    Vec3 x = first_axis_across(normal);
    Vec3 y = second_axis_across(normal);
    Vec3 local = vec3(dot(to_eye, x), dot(to_eye, y), max(dot(to_eye, normal), Float(1e-4)));
    Vec3 facet = ggx_visible_normal(local, alpha, u, v);
    return x * facet.x + y * facet.y + normal * facet.z;
}

// The way to a point of a rectangle; `axis_u` and `axis_v` are half a side each.
ARHOST_LEAF Vec3 way_to_rectangle(Vec3 way_to_centre, Vec3 axis_u, Vec3 axis_v, Float u, Float v) {
    return way_to_centre + axis_u * (u * Float(2.0) - Float(1.0)) + axis_v * (v * Float(2.0) - Float(1.0));
}

// The way to a point of a sphere's disc that faces us.
ARHOST_LEAF Vec3 way_to_disc(Vec3 way_to_centre, Float radius, Float u, Float v) {
    Vec3 n = normalize(way_to_centre);
    Float r = radius * sqrt(u);
    return way_to_centre + first_axis_across(n) * (r * cosine_of_turn(v)) +
           second_axis_across(n) * (r * sine_of_turn(v));
}

// Where `value` lies between a cumulative sum and the one after it, which is `step` more: 0 to 1.
ARHOST_LEAF Float place_in_step(Float value, Float sum_before, Float step) {
    return min((value - sum_before) / max(step, Float(1e-12)), Float(1.0));
}
