// SPDX-License-Identifier: Apache-2.0
//
// The surfaces that pixels show, for the denoiser. Equivalent to rt_embree's kernel/guides.inl.

// Of the ray through the pixel's centre; 0 if it meets no surface.
struct Guides {
    vec3 position, normal, albedo;
    uint surface;
};
Guides guides;

const float LEAST_DIVISOR = 1.0 / 64.0; // of the light of virtual objects

// The denoiser divides the light of a surface by its albedo, so that textures stay sharp. `is_lit`: neither a mirror nor
// glass.
vec3 divisor_of(Surface s, bool is_lit, bool is_unlit) {
    if (is_unlit)
        return max(s.emission, LEAST_DIVISOR);
    if (!is_lit || largest(s.emission) > 0.0)
        return vec3(1.0);
    return max(s.is_rough ? s.diffuse + s.specular : s.diffuse, LEAST_DIVISOR);
}

// Traces a ray through mirrors and glass, at each vertex along the branch with the larger throughput, to the first
// surface of another kind. The guides are the normal of that surface, and the position of its virtual image.
void follow_specular(Ray ray, Hit hit) {
    vec3 towards = normalize(ray.direction), through_pixel = towards;
    float travelled = 0.0;
    const int most_bounces = 8;
    for (int bounce = 0; bounce < most_bounces && hit.object != NONE; ++bounce) {
        Surface s = surface_at(ray, hit, true);
        travelled += s.distance;
        if (bounce == 0) {
            guides.position = s.position;
            guides.normal = s.normal;
        }
        uint material = objects[hit.object].material, model = materials[material].model;
        bool is_glass = has_glass && model == GLASS && materials[material].roughness == 0.0;
        if ((has_glass && materials[material].transmission > 0.0) || (objects[hit.object].flags & BLENDS) != 0u)
            add_material(s, hit, -towards);
        is_glass = is_glass || s.transmission > 0.5;
        bool is_passed = s.opacity < 0.5;
        if (model != MIRROR && !is_glass && !is_passed) {
            guides.position = frame.eye + through_pixel * travelled;
            guides.normal = s.normal;
            guides.surface += ((hit.object & 1023u) + 1u) * MIRRORED_UNIT;
            return;
        }
        bool refracts = false;
        vec3 next;
        if (is_passed) {
            refracts = true;
            next = towards;
        } else if (is_glass) {
            GlassScatter glass = scatter_at_glass(s, towards, material, vec2(0.0), false);
            refracts = glass.reflectance <= 0.5;
            next = refracts ? glass.refracted : glass.reflected;
        } else {
            next = reflected(s, towards);
        }
        towards = normalize(next);
        ray = Ray(refracts ? below(s) : above(s), towards, INFINITY, ALL_MASKS | OF_EYE);
        hit = trace(ray, false, false);
    }
}
