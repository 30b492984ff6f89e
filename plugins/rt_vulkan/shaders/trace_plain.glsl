// SPDX-License-Identifier: Apache-2.0
//
// Implements trace() with software traversal of the BVHs (bvh.hpp). The leaves of the top-level BVH are objects, each
// of which has a BVH in object space.

const int trace_stack_size = 64; // exceeds the sum of the depth limits in bvh.hpp

// Returns 1 / d. Replaces components near 0 with ±1e-18, which avoids infinities.
vec3 safe_reciprocal(vec3 d) {
    const float minimum = 1e-18;
    return 1.0 / mix(d, mix(vec3(minimum), vec3(-minimum), lessThan(d, vec3(0.0))), lessThan(abs(d), vec3(minimum)));
}

// Returns the t at which the ray enters the box, or INFINITY if it misses the box. The factor 1.000001 allows for
// rounding errors.
float box_entry(vec3 low, vec3 high, vec3 origin, vec3 reciprocal, float t_max) {
    vec3 a = (low - origin) * reciprocal, b = (high - origin) * reciprocal;
    vec3 enters = min(a, b), leaves = max(a, b);
    float first = max(max(enters.x, enters.y), max(enters.z, 0.0));
    float last = min(min(leaves.x, leaves.y), min(leaves.z, t_max));
    return first <= last * 1.000001 ? first : INFINITY;
}

Hit trace(Ray ray, bool any_hit, bool cull_back_faces) {
    Hit hit = no_hit(ray);
    if (!can_hit(ray))
        return hit;
    uint stack[trace_stack_size];
    int top = 0, bottom = 0; // `bottom`: index of the current object's first entry
    uint node = 0u, object = NONE;
    vec3 origin = ray.origin, direction = ray.direction, reciprocal = safe_reciprocal(direction);
    for (;;) {
        uint first = nodes[node].first, count = nodes[node].count;
        if (count == 0u) {
            float left = box_entry(nodes[first].low, nodes[first].high, origin, reciprocal, hit.t);
            float right = box_entry(nodes[first + 1u].low, nodes[first + 1u].high, origin, reciprocal, hit.t);
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
                    to_object_space(object, ray, origin, direction);
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
                if (cull_back_faces && dot(found.facet, direction) >= 0.0)
                    continue;
                if ((flags & IS_SPHERES) == 0u &&
                    passes(object, i, found.uv, origin, direction, (ray.mask & OF_EYE) != 0u))
                    continue;
                hit = found;
                hit.object = object;
                hit.primitive = i;
                if (any_hit)
                    return hit;
            }
        }
        if (object != NONE && top == bottom) { // the traversal of the object's BVH is complete
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
