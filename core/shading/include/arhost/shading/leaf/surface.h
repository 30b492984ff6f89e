// SPDX-License-Identifier: Apache-2.0
// Points of surfaces and their normals. A leaf file: see ../scalar.hpp.

ARHOST_LEAF Float largest(Vec3 a) {
    return max(max(abs(a.x), abs(a.y)), abs(a.z));
}

// `a` at length 1, even where the square of its length is too small to be told from 0; where it has none, `fallback`.
ARHOST_LEAF Vec3 unit_or(Vec3 a, Vec3 fallback) {
    Vec3 scaled = a * (Float(1.0) / max(largest(a), Float(1e-37)));
    Vec3 long_enough = select(dot(a, a) > Float(1e-30), a, scaled);
    return select(dot(scaled, scaled) > Float(0.5), normalize(long_enough), fallback);
}

// How far from a facet rays start that go on from a hit. A hit is as exact as the floats that it was computed
// from: 2^-24 of their size, a few times. `way` is the ray's, from its origin to the hit; `reach`, along each axis,
// is how far off the corners or the centre may be that say where the facet is. It counts as much as the axis goes
// with the normal, of length 1: across an axis a floor is exact, however large. All in the world, mm.
ARHOST_LEAF Float offset_from_surface(Vec3 position, Vec3 way, Vec3 normal, Vec3 reach) {
    Float across = abs(normal.x) * reach.x + abs(normal.y) * reach.y + abs(normal.z) * reach.z;
    return (largest(position) + largest(way) + across) * Float(1.0 / 524288.0);
}

// `normal`, or what is opposite to it, whichever does not point away from `to`.
ARHOST_LEAF Vec3 facing(Vec3 normal, Vec3 to) {
    return select(dot(normal, to) < Float(0.0), -normal, normal);
}

// The normal to shade with, from one interpolated between the vertices' and the facet's own of length 1, on whose
// side it is. Vertex normals that cancel out leave the facet's.
ARHOST_LEAF Vec3 shading_normal(Vec3 interpolated, Vec3 facet) {
    Vec3 n = select(dot(interpolated, interpolated) > Float(1e-12), normalize(interpolated), facet);
    return facing(n, facet);
}

// The directions in a triangle along which the texture's u and v grow, from two of its edges and what u and v grow
// by along them; of any length (E. Lengyel, Mathematics for 3D Game Programming and Computer Graphics, 2012,
// section 7.8).
ARHOST_LEAF Vec3 tangent_along_u(Vec3 edge_1, Vec3 edge_2, Float u1, Float u2, Float v1, Float v2) {
    return (edge_1 * v2 - edge_2 * v1) * select(u1 * v2 < u2 * v1, Float(-1.0), Float(1.0));
}
ARHOST_LEAF Vec3 tangent_along_v(Vec3 edge_1, Vec3 edge_2, Float u1, Float u2, Float v1, Float v2) {
    return (edge_2 * u1 - edge_1 * u2) * select(u1 * v2 < u2 * v1, Float(-1.0), Float(1.0));
}

// The normal that a normal texture's texel asks for in place of `normal`. The tangent is brought into the plane
// across the normal; the texture's green points against v (glTF 2.0, section 3.9.3). One that points into the facet
// would be taken for the back's: then, and where there is no tangent, `normal` stays.
ARHOST_LEAF Vec3 bent_normal(Vec3 normal, Vec3 facet, Vec3 along_u, Vec3 along_v, Vec3 texel) {
    Vec3 n = normalize(normal);
    Vec3 across = along_u - n * dot(n, along_u);
    Vec3 right = normalize(across);
    Vec3 side = cross(n, right);
    Vec3 up = select(dot(side, along_v) > Float(0.0), -side, side);
    Vec3 asked = right * (texel.x * Float(2.0) - Float(1.0)) + up * (texel.y * Float(2.0) - Float(1.0)) +
                 n * (texel.z * Float(2.0) - Float(1.0));
    Vec3 outwards = select(dot(asked, facing(facet, n)) > Float(0.0), asked, normal);
    return select(dot(across, across) > Float(0.0), outwards, normal);
}
