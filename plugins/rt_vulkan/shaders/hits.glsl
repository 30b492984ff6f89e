// SPDX-License-Identifier: Apache-2.0
//
// Rays and their intersections with triangles and spheres. Each path implements
//     Hit trace(Ray ray, bool any_hit, bool cull_back_faces)
// which returns the nearest hit. With `any_hit`, it may return any hit, of which only `object` is valid.

struct Ray {
    vec3 origin, direction;
    float t_max; // end of the ray, in lengths of `direction`
    uint mask;
};

struct Hit {
    float t; // distance, in lengths of the ray's direction
    vec2 uv; // barycentric coordinates of a triangle's second and third corner
    vec3 facet; // the geometric normal in object space, not normalized
    uint object, primitive; // `object` is NONE if there is no hit
};

Hit no_hit(Ray ray) {
    return Hit(ray.t_max, vec2(0.0), vec3(0.0), NONE, NONE);
}

// Tests the bits of the floats, because compilers may assume that there are no NaNs.
bool is_finite(float a) {
    return (floatBitsToUint(a) & 0x7f800000u) != 0x7f800000u;
}
bool is_finite(vec3 a) {
    return is_finite(a.x) && is_finite(a.y) && is_finite(a.z);
}

// Returns false if the ray has NaN, infinite or huge components, which result, for example, from triangles of 1e-15 mm.
// Tracing such a ray is undefined.
bool can_hit(Ray ray) {
    return frame.object_count != 0u && is_finite(ray.origin) && is_finite(ray.direction) &&
           largest(ray.origin) < 1e18 && largest(ray.direction) < 1e18 &&
           floatBitsToUint(ray.t_max) <= floatBitsToUint(INFINITY); // neither below 0 nor NaN
}

// ordered_dot() and ordered_cross() compute the same bits on all devices: they have a fixed order of evaluation and no
// fused operations. GLSL's own dot(), cross() and matrix products do not, because `precise` has no effect inside them.
float ordered_dot(vec3 a, vec3 b) {
    precise float sum = a.x * b.x + a.y * b.y + a.z * b.z;
    return sum;
}
vec3 ordered_cross(vec3 a, vec3 b) {
    precise vec3 product = a.yzx * b.zxy - a.zxy * b.yzx;
    return product;
}

void to_object_space(uint object, Ray ray, out vec3 origin, out vec3 direction) {
    origin = ray.origin;
    direction = ray.direction;
    if ((objects[object].flags & HAS_TRANSFORM) != 0u) {
        mat4x3 m = objects[object].object_from_world;
        precise vec3 position = m[0] * origin.x + m[1] * origin.y + m[2] * origin.z + m[3];
        precise vec3 along = m[0] * direction.x + m[1] * direction.y + m[2] * direction.z;
        origin = position;
        direction = along;
    }
}

// Returns where a texture is looked up at a vertex.
vec2 texcoord_of(uint object, uint vertex, uint number) {
    uint from = objects[object].first_texcoord +
                2u * (textures[number].texcoord_set * objects[object].vertex_count + vertex);
    vec2 columns[3] = textures[number].image_from_texcoord;
    return columns[0] * attributes[from] + columns[1] * attributes[from + 1u] + columns[2];
}
vec2 texcoord_at(uint object, uint triangle, vec2 uv, uint number) {
    uint first = objects[object].first_index + 3u * triangle;
    vec3 weights = vec3(1.0 - uv.x - uv.y, uv.x, uv.y);
    vec2 sum = vec2(0.0);
    for (int i = 0; i < 3; ++i)
        sum += texcoord_of(object, indices[first + uint(i)], number) * weights[i];
    return sum;
}

// Returns twice the area of a triangle in a texture, in the unit of u times that of v.
float area_in_texture(uint object, uint triangle, uint number) {
    uint first = objects[object].first_index + 3u * triangle;
    vec2 corner = texcoord_of(object, indices[first], number);
    vec2 edge_1 = texcoord_of(object, indices[first + 1u], number) - corner;
    vec2 edge_2 = texcoord_of(object, indices[first + 2u], number) - corner;
    return abs(edge_1.x * edge_2.y - edge_2.x * edge_1.y);
}

// `footprint`: as in Surface.
vec4 texel_at_hit(Hit hit, uint number, float footprint) {
    if (objects[hit.object].first_texcoord == NONE)
        return vec4(1.0);
    uint triangle = primitives[hit.primitive].number;
    float area = footprint > 0.0 ? footprint * area_in_texture(hit.object, triangle, number) : 0.0;
    return sample_texture(number, texcoord_at(hit.object, triangle, hit.uv, number), area);
}

// Returns the linear colour and the opacity of the vertices of a triangle; white if the object has none.
vec4 vertex_colour(uint object, uint triangle, vec2 uv) {
    uint base = objects[object].first_colour, first = objects[object].first_index + 3u * triangle;
    if (base == NONE)
        return vec4(1.0);
    vec3 weights = vec3(1.0 - uv.x - uv.y, uv.x, uv.y);
    vec4 sum = vec4(0.0);
    for (int i = 0; i < 3; ++i) {
        uint from = base + 2u * indices[first + uint(i)], low = indices[from], high = indices[from + 1u];
        sum += vec4(low & 0xffffu, low >> 16, high & 0xffffu, high >> 16) * (weights[i] * (1.0 / 65535.0));
    }
    return sum;
}

float opacity_at(uint object, uint triangle, vec2 uv) {
    uint material = objects[object].material, number = materials[material].colour_texture;
    float opacity = materials[material].opacity * vertex_colour(object, triangle, uv).a;
    if (has_textures && number != NONE && objects[object].first_texcoord != NONE)
        opacity *= sample_level(number, 0, texcoord_at(object, triangle, uv, number)).a;
    return opacity;
}

const float LEAST_OPACITY = 1.0 / 512.0; // the eye does not see points of a lower opacity

// Returns a number from 0 to 1 that depends on a ray, a triangle and the frame only.
float random_of_hit(vec3 origin, vec3 direction, uint triangle) {
    uint bits[7] = uint[](floatBitsToUint(origin.x), floatBitsToUint(origin.y), floatBitsToUint(origin.z),
                          floatBitsToUint(direction.x), floatBitsToUint(direction.y), floatBitsToUint(direction.z),
                          triangle);
    uint hash = frame.first_random;
    for (int i = 0; i < 7; ++i) { // MurmurHash3's finalizer
        hash = (hash ^ bits[i]) * 0x85ebca6bu;
        hash = (hash ^ (hash >> 13)) * 0xc2b2ae35u;
        hash ^= hash >> 16;
    }
    return float(hash >> 8) * (1.0 / 16777216.0);
}

// Returns whether a ray passes a triangle: where it is cut out, at back faces that are hidden from the eye, and, of other
// rays, at random where the triangle is translucent. `origin`, `direction`: of the ray in object space.
bool passes(uint object, uint primitive, vec2 uv, vec3 origin, vec3 direction, bool of_eye) {
    uint flags = objects[object].flags, triangle = primitives[primitive].number;
    if (!has_holes || (flags & (HAS_HOLES | HIDES_BACK_FACES | BLENDS)) == 0u)
        return false;
    if (of_eye && (flags & HIDES_BACK_FACES) != 0u &&
        ordered_dot(ordered_cross(primitives[primitive].edge_2, primitives[primitive].edge_1), direction) >= 0.0)
        return true;
    if ((flags & (HAS_HOLES | BLENDS)) == 0u)
        return false;
    float opacity = opacity_at(object, triangle, uv);
    if (opacity < materials[objects[object].material].alpha_cutoff)
        return true;
    return (flags & BLENDS) != 0u && opacity < (of_eye ? LEAST_OPACITY : random_of_hit(origin, direction, triangle));
}

// Intersects a ray with a triangle by the Möller-Trumbore algorithm, with the same operations as Embree. If the hit is
// not farther away than hit.t, updates `hit` and returns true.
bool hits_triangle(uint primitive, vec3 origin, vec3 direction, inout Hit hit) {
    vec3 edge_1 = primitives[primitive].edge_1, edge_2 = primitives[primitive].edge_2;
    vec3 to_corner = primitives[primitive].corner - origin;
    vec3 facet = ordered_cross(edge_2, edge_1), moment = ordered_cross(to_corner, direction);
    float along = ordered_dot(facet, direction), orientation = along < 0.0 ? -1.0 : 1.0, size = abs(along);
    float u = ordered_dot(moment, edge_2) * orientation, v = ordered_dot(moment, edge_1) * orientation;
    if (size == 0.0 || !(u >= 0.0) || !(v >= 0.0) || !(u + v <= size))
        return false;
    float t = ordered_dot(facet, to_corner) * orientation;
    if (!(t > 0.0) || !(t <= size * hit.t))
        return false;
    float scale = 1.0 / size;
    hit.t = t * scale;
    hit.uv = vec2(u, v) * scale;
    hit.facet = facet;
    return true;
}

bool hits_sphere(uint primitive, vec3 origin, vec3 direction, inout Hit hit) {
    precise vec3 to_centre = primitives[primitive].corner - origin;
    float radius = primitives[primitive].edge_1.x, scale = 1.0 / ordered_dot(direction, direction);
    precise float middle = ordered_dot(to_centre, direction) * scale;
    precise vec3 across = to_centre - direction * middle;
    precise float discriminant = radius * radius - ordered_dot(across, across);
    if (!(discriminant >= 0.0))
        return false;
    precise float half_chord = sqrt(discriminant * scale);
    precise float front = middle - half_chord, back = middle + half_chord;
    bool from_outside = front >= 0.0 && front <= hit.t;
    if (!from_outside && !(back >= 0.0 && back <= hit.t))
        return false;
    hit.t = from_outside ? front : back;
    hit.uv = vec2(0.0);
    precise vec3 outwards = direction * (from_outside ? -half_chord : half_chord) - across;
    hit.facet = outwards;
    return true;
}

vec3 facet_of(uint primitive) {
    return ordered_cross(primitives[primitive].edge_2, primitives[primitive].edge_1);
}

// Returns a · b + c with a single rounding (T. J. Dekker, A Floating-Point Technique for Extending the Available
// Precision, 1971; for the sum: D. E. Knuth, The Art of Computer Programming 2, 4.2.2). GLSL's fma() may round twice.
vec3 fused(float a, vec3 b, vec3 c) {
    const float half_of_the_bits = 4097.0;
    precise float a_wide = a * half_of_the_bits, a_high = a_wide - (a_wide - a), a_low = a - a_high;
    precise vec3 b_wide = b * half_of_the_bits, b_high = b_wide - (b_wide - b), b_low = b - b_high;
    precise vec3 product = b * a;
    precise vec3 rest = ((b_high * a_high - product) + b_low * a_high + b_high * a_low) + b_low * a_low;
    precise vec3 sum = product + c, added = sum - product;
    precise vec3 result = sum + (((product - (sum - added)) + (c - added)) + rest);
    return result;
}

// Recomputes t and the barycentric coordinates of a hit relative to the hit point, which reduces rounding errors. For
// small triangles far away, the original coordinates have errors of 1e-5 and more, which glass magnifies.
void refine(Ray ray, inout Hit hit) {
    if (hit.object == NONE || (objects[hit.object].flags & IS_SPHERES) != 0u)
        return;
    vec3 origin, direction;
    to_object_space(hit.object, ray, origin, direction);
    vec3 edge_1 = primitives[hit.primitive].edge_1, edge_2 = primitives[hit.primitive].edge_2;
    vec3 to_corner = fused(-hit.t, direction, primitives[hit.primitive].corner - origin);
    vec3 moment = ordered_cross(to_corner, direction);
    precise float scale = 1.0 / ordered_dot(hit.facet, direction);
    precise float t = hit.t + ordered_dot(hit.facet, to_corner) * scale;
    vec2 uv = vec2(ordered_dot(moment, edge_2), ordered_dot(moment, edge_1)) * scale;
    if (is_finite(vec3(uv, t)) && t > 0.0) { // false if the ray is parallel to the triangle
        hit.uv = uv;
        hit.t = t;
    }
}

// Recomputes a hit reported by the device with the formulas of the path `plain`, so that all paths agree to the last
// bit. At edges, these formulas may find no hit; the function then keeps the device's values.
Hit recomputed_hit(Ray ray, uint object, uint primitive, float t, vec2 uv) {
    vec3 origin, direction;
    to_object_space(object, ray, origin, direction);
    Hit hit = Hit(INFINITY, vec2(0.0), vec3(0.0), object, primitive);
    if (!((objects[object].flags & IS_SPHERES) != 0u ? hits_sphere(primitive, origin, direction, hit)
                                                     : hits_triangle(primitive, origin, direction, hit)))
        hit = Hit(t, uv, facet_of(primitive), object, primitive);
    refine(ray, hit);
    return hit;
}
