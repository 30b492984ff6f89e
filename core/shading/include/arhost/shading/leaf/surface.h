// SPDX-License-Identifier: Apache-2.0
// Surface points and normals. A leaf file: see ../scalar.hpp.

// Maximum norm.
ARHOST_LEAF Float largest(Vec3 a) {
    return max(max(abs(a.x), abs(a.y)), abs(a.z));
}

// Unit vector along `a`, correct also if the squared length of `a` underflows; `fallback` if `a` is 0.
ARHOST_LEAF Vec3 normalize_or(Vec3 a, Vec3 fallback) {
    Vec3 scaled = a * (Float(1.0) / max(largest(a), Float(1e-37)));
    Vec3 long_enough = select(dot(a, a) > Float(1e-30), a, scaled);
    return select(dot(scaled, scaled) > Float(0.5), normalize(long_enough), fallback);
}

// Distance from the surface at which secondary rays start, to avoid self-intersection; world space, mm. The error of
// a hit point is a few times 2^-24 of the magnitudes from which it was computed: `position` (the hit point), `ray`
// (from the ray's origin to the hit point) and `extent` (maximum distance of the object's points from its origin
// along each world axis). `extent` is weighted by the unit `normal`, because only errors along the normal matter: the
// height of a level floor, for example, is exact however large the floor is.
ARHOST_LEAF Float offset_from_surface(Vec3 position, Vec3 ray, Vec3 normal, Vec3 extent) {
    Float along_normal = abs(normal.x) * extent.x + abs(normal.y) * extent.y + abs(normal.z) * extent.z;
    return (largest(position) + largest(ray) + along_normal) * Float(1.0 / 524288.0);
}

// `normal`, flipped if necessary so that it does not point away from `to`.
ARHOST_LEAF Vec3 facing(Vec3 normal, Vec3 to) {
    return select(dot(normal, to) < Float(0.0), -normal, normal);
}

// Unit shading normal on the side of the geometric normal `facet` (unit length); `facet` itself if the interpolated
// vertex normals cancel out.
ARHOST_LEAF Vec3 shading_normal(Vec3 interpolated, Vec3 facet) {
    Vec3 n = select(dot(interpolated, interpolated) > Float(1e-12), normalize(interpolated), facet);
    return facing(n, facet);
}

// `normal`, bent towards `to_eye` if necessary so that the mirrored ray leaves the surface: half of the angle between
// `to_eye` and the mirrored ray, raised above the facet. Otherwise, steep normal maps and silhouettes of smooth
// meshes would be black. All vectors have unit length; `normal` and `to_eye` are on the side of the geometric normal
// `facet` (C. Keller et al., The Iray Light Transport Simulation and Rendering System, 2017, section A.3).
ARHOST_LEAF Vec3 reflecting_normal(Vec3 normal, Vec3 facet, Vec3 to_eye) {
    Vec3 mirrored = normal * (dot(normal, to_eye) * Float(2.0)) - to_eye;
    Float least = min(dot(facet, to_eye) * Float(0.9), Float(0.01));
    Float height = dot(mirrored, facet);
    Vec3 raised = normalize_or(mirrored + facet * (least - height), facet);
    return select(height < least, normalize_or(to_eye + raised, facet), normal);
}

// Contribution of one corner to the vector from a point of a flat triangle to the curved surface that the vertex
// normals describe. The vector is the mean of the three contributions, weighted by the barycentric coordinates.
// Shadow rays start on the curved surface, so that facets do not shadow themselves where this surface is lit.
// `to_corner`: vector from the point to the corner; `normal`: the corner's normal, of any length. Returns 0 where the
// surface is concave (J. Hanika, Hacking the Shadow Terminator, Ray Tracing Gems II, 2021).
ARHOST_LEAF Vec3 lift_to_corner(Vec3 to_corner, Vec3 normal) {
    return normal * (max(dot(to_corner, normal), Float(0.0)) / max(dot(normal, normal), Float(1e-30)));
}

// Directions in which the texture coordinates u and v of a triangle increase; not normalized. Computed from two edges
// and the changes of u and v along these edges (E. Lengyel, Mathematics for 3D Game Programming and Computer
// Graphics, 2012, section 7.8).
ARHOST_LEAF Vec3 tangent_along_u(Vec3 edge_1, Vec3 edge_2, Float u1, Float u2, Float v1, Float v2) {
    return (edge_1 * v2 - edge_2 * v1) * select(u1 * v2 < u2 * v1, Float(-1.0), Float(1.0));
}
ARHOST_LEAF Vec3 tangent_along_v(Vec3 edge_1, Vec3 edge_2, Float u1, Float u2, Float v1, Float v2) {
    return (edge_2 * u1 - edge_1 * u2) * select(u1 * v2 < u2 * v1, Float(-1.0), Float(1.0));
}

// Unit vector along `along_u`, made orthogonal to the unit `normal`; any such vector if there is none.
ARHOST_LEAF Vec3 tangent_of(Vec3 normal, Vec3 along_u, Vec3 fallback) {
    return normalize_or(along_u - normal * dot(normal, along_u), fallback);
}

// Perturbs `normal` by the `texel` of a normal map. Makes the tangent orthogonal to the normal; the green axis points
// in the direction of decreasing v (glTF 2.0, section 3.9.3). Returns `normal` unchanged if the result would point
// into the surface or if there is no tangent. `facet`: geometric normal;
// `scale`: of red and green.
ARHOST_LEAF Vec3 perturbed_normal(Vec3 normal, Vec3 facet, Vec3 along_u, Vec3 along_v, Vec3 texel, Float scale) {
    Vec3 n = normalize(normal);
    Vec3 tangent = along_u - n * dot(n, along_u);
    Vec3 right = normalize(tangent);
    Vec3 side = cross(n, right);
    Vec3 up = select(dot(side, along_v) > Float(0.0), -side, side);
    Vec3 mapped = right * ((texel.x * Float(2.0) - Float(1.0)) * scale) +
                  up * ((texel.y * Float(2.0) - Float(1.0)) * scale) + n * (texel.z * Float(2.0) - Float(1.0));
    Vec3 outwards = select(dot(mapped, facing(facet, n)) > Float(0.0), mapped, normal);
    return select(dot(tangent, tangent) > Float(0.0), outwards, normal);
}
