// SPDX-License-Identifier: Apache-2.0
//
// What rays hit, by VK_KHR_ray_query: the device walks trees of its own (acceleration.hpp) and asks here about spheres,
// and about what may be a hole or face away.

layout(set = 0, binding = 15) uniform accelerationStructureEXT trees;

Hit trace(Ray ray, bool any, bool passes_backs) {
    if (!can_hit(ray))
        return no_hit(ray);
    rayQueryEXT query;
    rayQueryInitializeEXT(query, trees,
                          (any ? gl_RayFlagsTerminateOnFirstHitEXT : gl_RayFlagsNoneEXT) |
                              (passes_backs ? gl_RayFlagsNoOpaqueEXT : gl_RayFlagsNoneEXT),
                          ray.mask, ray.origin, 0.0, ray.direction, ray.end);
    while (rayQueryProceedEXT(query)) {
        uint object = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, false));
        uint primitive = objects[object].root + uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, false));
        vec3 origin, direction;
        to_axes_of(object, ray, origin, direction);
        if (rayQueryGetIntersectionTypeEXT(query, false) == gl_RayQueryCandidateIntersectionAABBEXT) {
            Hit found = no_hit(ray);
            if (rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT)
                found.way = rayQueryGetIntersectionTEXT(query, true);
            if (hits_sphere(primitive, origin, direction, found) &&
                !(passes_backs && dot(found.facet, direction) >= 0.0))
                rayQueryGenerateIntersectionEXT(query, found.way);
        } else if (!(passes_backs && dot(facet_of(primitive), direction) >= 0.0) &&
                   !is_hole(object, primitive, rayQueryGetIntersectionBarycentricsEXT(query, false))) {
            rayQueryConfirmIntersectionEXT(query);
        }
    }
    uint type = rayQueryGetIntersectionTypeEXT(query, true);
    if (type == gl_RayQueryCommittedIntersectionNoneEXT)
        return no_hit(ray);
    uint object = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true));
    if (any)
        return Hit(ray.end, vec2(0.0), vec3(0.0), object, 0u);
    vec2 at = vec2(0.0);
    if (type == gl_RayQueryCommittedIntersectionTriangleEXT)
        at = rayQueryGetIntersectionBarycentricsEXT(query, true);
    return hit_of(ray, object, objects[object].root + uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true)),
                  rayQueryGetIntersectionTEXT(query, true), at);
}
