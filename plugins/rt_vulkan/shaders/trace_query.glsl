// SPDX-License-Identifier: Apache-2.0
//
// Implements trace() with VK_KHR_ray_query. The device traverses its acceleration structures. This shader tests the
// candidates that the device cannot decide: spheres, and triangles that may have holes or be back faces.

layout(set = 0, binding = 16) uniform accelerationStructureEXT top_level;

Hit trace(Ray ray, bool any_hit, bool cull_back_faces) {
    if (!can_hit(ray))
        return no_hit(ray);
    rayQueryEXT query;
    rayQueryInitializeEXT(query, top_level,
                          (any_hit ? gl_RayFlagsTerminateOnFirstHitEXT : gl_RayFlagsNoneEXT) |
                              (cull_back_faces ? gl_RayFlagsNoOpaqueEXT : gl_RayFlagsNoneEXT),
                          ray.mask, ray.origin, 0.0, ray.direction, ray.t_max);
    while (rayQueryProceedEXT(query)) {
        uint object = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, false));
        uint primitive = objects[object].root + uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, false));
        vec3 origin, direction;
        to_object_space(object, ray, origin, direction);
        if (rayQueryGetIntersectionTypeEXT(query, false) == gl_RayQueryCandidateIntersectionAABBEXT) {
            Hit found = no_hit(ray);
            if (rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT)
                found.t = rayQueryGetIntersectionTEXT(query, true);
            if (hits_sphere(primitive, origin, direction, found) &&
                !(cull_back_faces && dot(found.facet, direction) >= 0.0))
                rayQueryGenerateIntersectionEXT(query, found.t);
        } else if (!(cull_back_faces && dot(facet_of(primitive), direction) >= 0.0) &&
                   !passes(object, primitive, rayQueryGetIntersectionBarycentricsEXT(query, false), origin, direction,
                           (ray.mask & OF_EYE) != 0u)) {
            rayQueryConfirmIntersectionEXT(query);
        }
    }
    uint type = rayQueryGetIntersectionTypeEXT(query, true);
    if (type == gl_RayQueryCommittedIntersectionNoneEXT)
        return no_hit(ray);
    uint object = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true));
    if (any_hit)
        return Hit(ray.t_max, vec2(0.0), vec3(0.0), object, 0u);
    vec2 uv = vec2(0.0);
    if (type == gl_RayQueryCommittedIntersectionTriangleEXT)
        uv = rayQueryGetIntersectionBarycentricsEXT(query, true);
    return recomputed_hit(ray, object, objects[object].root + uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true)),
                  rayQueryGetIntersectionTEXT(query, true), uv);
}
