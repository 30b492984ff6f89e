// SPDX-License-Identifier: Apache-2.0
//
// Implements trace() with VK_KHR_ray_tracing_pipeline. The device traverses its acceleration structures and calls
// pipeline.rint for spheres, pipeline.rahit for possible holes and back faces, and finally pipeline.rchit or
// pipeline.rmiss. These shaders do not trace further rays; only the integrator's loop does.

layout(set = 0, binding = 16) uniform accelerationStructureEXT top_level;
layout(location = 0) rayPayloadEXT Payload payload;

Hit trace(Ray ray, bool any_hit, bool cull_back_faces) {
    if (!can_hit(ray))
        return no_hit(ray);
    payload.object = 0u; // value if the closest-hit shader is skipped; any value but MISS reports a hit
    payload.of_eye = ray.mask & OF_EYE;
    traceRayEXT(top_level,
                (any_hit ? gl_RayFlagsTerminateOnFirstHitEXT | gl_RayFlagsSkipClosestHitShaderEXT : gl_RayFlagsNoneEXT) |
                    (cull_back_faces ? gl_RayFlagsNoOpaqueEXT : gl_RayFlagsNoneEXT),
                ray.mask, 0, 0, 0, ray.origin, 0.0, ray.direction, ray.t_max, 0);
    if (payload.object == MISS)
        return no_hit(ray);
    if (any_hit)
        return Hit(ray.t_max, vec2(0.0), vec3(0.0), payload.object, 0u);
    return recomputed_hit(ray, payload.object, objects[payload.object].root + payload.number, payload.t, payload.uv);
}
