// SPDX-License-Identifier: Apache-2.0
//
// What rays hit, by VK_KHR_ray_tracing_pipeline: the device walks trees of its own (acceleration.hpp) and calls the
// shaders pipeline.rint about spheres, pipeline.rahit about what may be a hole or face away, and in the end
// pipeline.rchit or pipeline.rmiss. None of them sends rays: those that go on are sent by the integrator's loop.

layout(set = 0, binding = 15) uniform accelerationStructureEXT trees;
layout(location = 0) rayPayloadEXT Found met;

Hit trace(Ray ray, bool any, bool passes_backs) {
    if (!can_hit(ray))
        return no_hit(ray);
    met.object = 0u; // of a hit by `any`, whose object is of no matter
    traceRayEXT(trees,
                (any ? gl_RayFlagsTerminateOnFirstHitEXT | gl_RayFlagsSkipClosestHitShaderEXT : gl_RayFlagsNoneEXT) |
                    (passes_backs ? gl_RayFlagsNoOpaqueEXT : gl_RayFlagsNoneEXT),
                ray.mask, 0, 0, 0, ray.origin, 0.0, ray.direction, ray.end, 0);
    if (met.object == FOUND_NOTHING)
        return no_hit(ray);
    if (any)
        return Hit(ray.end, vec2(0.0), vec3(0.0), met.object, 0u);
    return hit_of(ray, met.object, objects[met.object].root + met.number, met.way, met.at);
}
