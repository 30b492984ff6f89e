// SPDX-License-Identifier: Apache-2.0
//
// What rays hit: a walk through trees of our own (bvh.hpp), which any device can do. The top tree's leaves are
// objects, each with a tree over its geometry, in its own axes.

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

Hit trace(Ray ray, bool any, bool passes_backs) {
    Hit hit = no_hit(ray);
    if (!can_hit(ray))
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
                    to_axes_of(object, ray, origin, direction);
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
                if (is_hole(object, i, found.at))
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
            break;
        node = stack[--top];
    }
    refine(ray, hit);
    return hit;
}
