// SPDX-License-Identifier: Apache-2.0
//
// What rays hit: a walk through trees of our own (bvh.hpp), which any device can do. The top tree's leaves are
// objects, each with a tree over its geometry, in its own axes.

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

const int trace_stack_size = 64; // bvh.cpp keeps the trees' depths below it

vec3 safe_reciprocal(vec3 d) {
    const float least = 1e-18;
    return 1.0 / mix(d, mix(vec3(least), vec3(-least), lessThan(d, vec3(0.0))), lessThan(abs(d), vec3(least)));
}

// How far away the box begins, INFINITY where the ray passes it. The margin outweighs what rounding loses.
float way_to_box(vec3 low, vec3 high, vec3 origin, vec3 reciprocal, float end) {
    vec3 a = (low - origin) * reciprocal, b = (high - origin) * reciprocal;
    vec3 enters = min(a, b), leaves = max(a, b);
    float first = max(max(enters.x, enters.y), max(enters.z, 0.0));
    float last = min(min(leaves.x, leaves.y), min(leaves.z, end));
    return first <= last * 1.000001 ? first : INFINITY;
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

bool is_hole(uint object, uint number, vec2 at) {
    uint material = objects[object].material;
    return sample_texture(materials[material].colour_texture, texcoord_at(object, number, at)).a <
           materials[material].alpha_cutoff;
}

// As Embree's: the numbers are to agree to the last bits.
bool hits_triangle(uint primitive, vec3 origin, vec3 direction, inout Hit hit) {
    precise vec3 edge_1 = primitives[primitive].edge_1, edge_2 = primitives[primitive].edge_2;
    precise vec3 to_corner = primitives[primitive].corner - origin;
    precise vec3 facet = cross(edge_2, edge_1), moment = cross(to_corner, direction);
    precise float along = dot(facet, direction);
    float turned = along < 0.0 ? -1.0 : 1.0, size = abs(along);
    precise float u = dot(moment, edge_2) * turned, v = dot(moment, edge_1) * turned;
    if (size == 0.0 || !(u >= 0.0) || !(v >= 0.0) || !(u + v <= size))
        return false;
    precise float way = dot(facet, to_corner) * turned;
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
    float radius = primitives[primitive].edge_1.x, share = 1.0 / dot(direction, direction);
    precise float middle = dot(to_centre, direction) * share;
    precise vec3 across = to_centre - direction * middle;
    precise float left = radius * radius - dot(across, across);
    if (!(left >= 0.0))
        return false;
    precise float half_way = sqrt(left * share);
    float front = middle - half_way, back = middle + half_way;
    bool from_outside = front >= 0.0 && front <= hit.way;
    if (!from_outside && !(back >= 0.0 && back <= hit.way))
        return false;
    hit.way = from_outside ? front : back;
    hit.at = vec2(0.0);
    hit.facet = direction * (from_outside ? -half_way : half_way) - across;
    return true;
}

// The nearest hit; with `any`, the first that is found. A catcher that faces away does not count where
// `passes_backs`.
Hit trace(Ray ray, bool any, bool passes_backs) {
    Hit hit = Hit(ray.end, vec2(0.0), vec3(0.0), NONE, NONE);
    // Where numbers have left the range of floats, among facets of 1e-15 mm say, nothing is hit.
    if (frame.object_count == 0u || !(largest(ray.origin) < 1e18) || !(largest(ray.direction) < 1e18) ||
        !(dot(ray.direction, ray.direction) >= 0.0))
        return hit;
    uint stack[trace_stack_size];
    int top = 0, bottom = 0; // `bottom`: of the object's tree that is walked
    uint node = 0u, object = NONE;
    vec3 origin = ray.origin, direction = ray.direction, reciprocal = safe_reciprocal(direction);
    for (;;) {
        uint first = nodes[node].first, count = nodes[node].count;
        if (count == 0u) {
            float left = way_to_box(nodes[first].low, nodes[first].high, origin, reciprocal, hit.way);
            float right = way_to_box(nodes[first + 1u].low, nodes[first + 1u].high, origin, reciprocal, hit.way);
            bool right_first = right < left;
            if (min(left, right) < INFINITY) {
                node = right_first ? first + 1u : first;
                if (max(left, right) < INFINITY)
                    stack[top++] = right_first ? first : first + 1u;
                continue;
            }
        } else if (object == NONE) {
            if ((objects[first].mask & ray.mask) != 0u) {
                object = first;
                bottom = top;
                if ((objects[object].flags & HAS_TRANSFORM) != 0u) {
                    origin = objects[object].object_from_world * vec4(ray.origin, 1.0);
                    direction = objects[object].object_from_world * vec4(ray.direction, 0.0);
                    reciprocal = safe_reciprocal(direction);
                }
                node = objects[object].root;
                continue;
            }
        } else {
            uint flags = objects[object].flags;
            for (uint i = first; i < first + count; ++i) {
                Hit found = hit;
                if ((flags & IS_SPHERES) != 0u ? !hits_sphere(i, origin, direction, found)
                                               : !hits_triangle(i, origin, direction, found))
                    continue;
                if (passes_backs && dot(found.facet, direction) >= 0.0)
                    continue;
                if (has_holes && (flags & HAS_HOLES) != 0u && is_hole(object, primitives[i].number, found.at))
                    continue;
                hit = found;
                hit.object = object;
                hit.primitive = i;
                if (any)
                    return hit;
            }
        }
        if (object != NONE && top == bottom) { // the object's tree is done
            object = NONE;
            origin = ray.origin;
            direction = ray.direction;
            reciprocal = safe_reciprocal(direction);
        }
        if (top == 0)
            return hit;
        node = stack[--top];
    }
}
