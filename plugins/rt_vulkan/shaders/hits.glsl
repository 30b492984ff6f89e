// SPDX-License-Identifier: Apache-2.0
//
// Rays, and where they meet triangles and spheres. Of the paths each has its own
//     Hit trace(Ray ray, bool any, bool passes_backs)
// which gives the nearest hit; with `any`, only whether there is one, by its object. A surface that faces away does not
// count where `passes_backs`.

struct Ray {
    vec3 origin, direction;
    float end; // of the way, in lengths of `direction`
    uint mask;
};

struct Hit {
    float way; // in lengths of the ray's direction
    vec2 at;   // of a triangle: the shares of its second and third corner
    vec3 facet; // the facet's normal in the object's axes, of any length
    uint object, primitive; // object NONE: nothing
};

Hit no_hit(Ray ray) {
    return Hit(ray.end, vec2(0.0), vec3(0.0), NONE, NONE);
}

// By their bits: compilers may take it that there is no NaN.
bool is_finite(float a) {
    return (floatBitsToUint(a) & 0x7f800000u) != 0x7f800000u;
}
bool is_finite(vec3 a) {
    return is_finite(a.x) && is_finite(a.y) && is_finite(a.z);
}

// Where numbers have left the range of floats, among facets of 1e-15 mm say, nothing is hit; nor may a device be asked.
bool can_hit(Ray ray) {
    return frame.object_count != 0u && is_finite(ray.origin) && is_finite(ray.direction) &&
           largest(ray.origin) < 1e18 && largest(ray.direction) < 1e18 &&
           floatBitsToUint(ray.end) <= floatBitsToUint(INFINITY); // neither below 0 nor NaN
}

// In one order and without fused operations: `precise` does not reach into GLSL's own dot(), cross() and products of
// matrices.
float ordered_dot(vec3 a, vec3 b) {
    precise float sum = a.x * b.x + a.y * b.y + a.z * b.z;
    return sum;
}
vec3 ordered_cross(vec3 a, vec3 b) {
    precise vec3 product = a.yzx * b.zxy - a.zxy * b.yzx;
    return product;
}

void to_axes_of(uint object, Ray ray, out vec3 origin, out vec3 direction) {
    origin = ray.origin;
    direction = ray.direction;
    if ((objects[object].flags & HAS_TRANSFORM) != 0u) {
        mat4x3 m = objects[object].object_from_world;
        precise vec3 at = m[0] * origin.x + m[1] * origin.y + m[2] * origin.z + m[3];
        precise vec3 along = m[0] * direction.x + m[1] * direction.y + m[2] * direction.z;
        origin = at;
        direction = along;
    }
}

vec2 texcoord_at(uint object, uint number, vec2 at) {
    uint first = objects[object].first_index + 3u * number, base = objects[object].first_texcoord;
    vec3 share = vec3(1.0 - at.x - at.y, at.x, at.y);
    vec2 sum = vec2(0.0);
    for (int i = 0; i < 3; ++i) {
        uint from = base + 2u * indices[first + uint(i)];
        sum += vec2(attributes[from], attributes[from + 1u]) * share[i];
    }
    return sum;
}

bool is_hole(uint object, uint primitive, vec2 at) {
    if (!has_holes || (objects[object].flags & HAS_HOLES) == 0u)
        return false;
    uint material = objects[object].material;
    vec2 place = texcoord_at(object, primitives[primitive].number, at);
    return sample_texture(materials[material].colour_texture, place).a < materials[material].alpha_cutoff;
}

// As Embree's.
bool hits_triangle(uint primitive, vec3 origin, vec3 direction, inout Hit hit) {
    vec3 edge_1 = primitives[primitive].edge_1, edge_2 = primitives[primitive].edge_2;
    vec3 to_corner = primitives[primitive].corner - origin;
    vec3 facet = ordered_cross(edge_2, edge_1), moment = ordered_cross(to_corner, direction);
    float along = ordered_dot(facet, direction), turned = along < 0.0 ? -1.0 : 1.0, size = abs(along);
    float u = ordered_dot(moment, edge_2) * turned, v = ordered_dot(moment, edge_1) * turned;
    if (size == 0.0 || !(u >= 0.0) || !(v >= 0.0) || !(u + v <= size))
        return false;
    float way = ordered_dot(facet, to_corner) * turned;
    if (!(way > 0.0) || !(way <= size * hit.way))
        return false;
    float share = 1.0 / size;
    hit.way = way * share;
    hit.at = vec2(u, v) * share;
    hit.facet = facet;
    return true;
}

bool hits_sphere(uint primitive, vec3 origin, vec3 direction, inout Hit hit) {
    precise vec3 to_centre = primitives[primitive].corner - origin;
    float radius = primitives[primitive].edge_1.x, share = 1.0 / ordered_dot(direction, direction);
    precise float middle = ordered_dot(to_centre, direction) * share;
    precise vec3 across = to_centre - direction * middle;
    precise float left = radius * radius - ordered_dot(across, across);
    if (!(left >= 0.0))
        return false;
    precise float half_way = sqrt(left * share);
    precise float front = middle - half_way, back = middle + half_way;
    bool from_outside = front >= 0.0 && front <= hit.way;
    if (!from_outside && !(back >= 0.0 && back <= hit.way))
        return false;
    hit.way = from_outside ? front : back;
    hit.at = vec2(0.0);
    precise vec3 outwards = direction * (from_outside ? -half_way : half_way) - across;
    hit.facet = outwards;
    return true;
}

vec3 facet_of(uint primitive) {
    return ordered_cross(primitives[primitive].edge_2, primitives[primitive].edge_1);
}

// a · b + c, rounded once (T. J. Dekker, A Floating-Point Technique for Extending the Available Precision, 1971;
// the sum: D. E. Knuth, The Art of Computer Programming 2, 4.2.2). GLSL's fma() need not be.
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

// On the way to a small facet rounding takes 1e-5 and more of the hit's shares, which glass magnifies: here they are
// computed anew from where the ray arrives.
void refine(Ray ray, inout Hit hit) {
    if (hit.object == NONE || (objects[hit.object].flags & IS_SPHERES) != 0u)
        return;
    vec3 origin, direction;
    to_axes_of(hit.object, ray, origin, direction);
    vec3 edge_1 = primitives[hit.primitive].edge_1, edge_2 = primitives[hit.primitive].edge_2;
    vec3 to_corner = fused(-hit.way, direction, primitives[hit.primitive].corner - origin);
    vec3 moment = ordered_cross(to_corner, direction);
    precise float share = 1.0 / ordered_dot(hit.facet, direction);
    precise float way = hit.way + ordered_dot(hit.facet, to_corner) * share;
    vec2 at = vec2(ordered_dot(moment, edge_2), ordered_dot(moment, edge_1)) * share;
    if (is_finite(vec3(at, way)) && way > 0.0) { // not along the facet
        hit.at = at;
        hit.way = way;
    }
}

// What the device has found in trees of its own, by our formulas, so that the paths agree to the last bits. At an
// edge, where ours may find nothing, as the device has it.
Hit hit_of(Ray ray, uint object, uint primitive, float way, vec2 at) {
    vec3 origin, direction;
    to_axes_of(object, ray, origin, direction);
    Hit hit = Hit(INFINITY, vec2(0.0), vec3(0.0), object, primitive);
    if (!((objects[object].flags & IS_SPHERES) != 0u ? hits_sphere(primitive, origin, direction, hit)
                                                     : hits_triangle(primitive, origin, direction, hit)))
        hit = Hit(way, at, facet_of(primitive), object, primitive);
    refine(ray, hit);
    return hit;
}
