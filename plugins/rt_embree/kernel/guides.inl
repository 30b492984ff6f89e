// SPDX-License-Identifier: Apache-2.0
//
// The surfaces that pixels show, for the denoiser.
#pragma once
#include "path_catcher.inl"

// Returns the lanes in which the eye sees through the surfaces of an object, clearly.
ARHOST_INLINE Bool is_seen_through(const Scene &scene, const Object &object, const RTCHit16 &hit, Bool here) {
    const arhost_material &material = *object.material;
    Bool through = bool_of(false);
    if (object.blends) {
        Float opacity = Float(material.opacity) * vertex_colour(object, hit, here).alpha;
        if (material.colour_texture != ARHOST_NONE)
            opacity =
                opacity * sample_object_texture(scene, object, material.colour_texture, hit, here, Float(0.0f)).alpha;
        through = opacity < Float(1.0f);
    }
    constexpr float clear = 0.05f; // roughness
    if (material.model == ARHOST_MATERIAL_METALLIC_ROUGHNESS && material.transmission > 0 &&
        material.roughness <= clear) {
        Float transmission = Float(material.transmission);
        if (material.transmission_texture != ARHOST_NONE)
            transmission =
                transmission *
                sample_object_texture(scene, object, material.transmission_texture, hit, here, Float(0.0f)).colour.x;
        through = through | (transmission > Float(0.5f));
    }
    return here & through;
}

// Returns the numbers of the surfaces hit (surface_number()). Points that are seen through are specular.
ARHOST_INLINE Int surface_of(const Scene &scene, const RTCHit16 &hit, Bool active) {
    Int kinds(0);
    for_each_object(scene, hit, active, [&](const Object &object, Bool here) {
        const arhost_material_model model = object.material->model;
        SurfaceKind kind = scattering_surface;
        if (object.role != ARHOST_ROLE_VIRTUAL)
            kind = real_surface;
        else if (model == ARHOST_MATERIAL_METAL || model == ARHOST_MATERIAL_METALLIC_ROUGHNESS ||
                 (model == ARHOST_MATERIAL_GLASS && object.material->roughness > 0))
            kind = glossy_surface;
        else if (model == ARHOST_MATERIAL_MIRROR || model == ARHOST_MATERIAL_GLASS)
            kind = specular_surface;
        kinds = select(here, Int(kind), kinds);
        if (object.role == ARHOST_ROLE_VIRTUAL)
            kinds = select(is_seen_through(scene, object, hit, here), Int(specular_surface), kinds);
    });
    return surface_number(object_number(scene, hit), kinds) & Int(mirrored_unit - 1);
}
struct Guides {
    Vec3 position, normal, albedo;
    Int surface;
};
ARHOST_INLINE void put_guides(const Work &work, int first_pixel, const Guides &guides, Bool active) {
    const Float values[] = {guides.position.x, guides.position.y,       guides.position.z, guides.normal.x,
                            guides.normal.y,   guides.normal.z,         guides.albedo.x,   guides.albedo.y,
                            guides.albedo.z,   float_of(guides.surface)};
    for (int row = 0; row < guide_rows; ++row) {
        float *to = work.scratch.guide[row] + first_pixel;
        store(to, select(active, values[row], load(to)));
    }
}

constexpr float least_divisor = 1.0f / 64; // of the light of virtual objects

// The denoiser divides the light of a surface by its albedo, so that textures stay sharp.
ARHOST_INLINE Vec3 divisor_of(const Surface &s) {
    const Vec3 gloss = select(s.is_rough, s.specular, black());
    const Bool divides = s.is_lit & ~(largest(s.emission) > Float(0.0f));
    const auto of = [&](Float a, Float b) __attribute__((always_inline)) {
        return select(divides, max(a + b, Float(least_divisor)), Float(1.0f));
    };
    const Vec3 unlit{max(s.emission.x, Float(least_divisor)), max(s.emission.y, Float(least_divisor)),
                     max(s.emission.z, Float(least_divisor))};
    return select(s.is_unlit, unlit, {of(s.diffuse.x, gloss.x), of(s.diffuse.y, gloss.y), of(s.diffuse.z, gloss.z)});
}

// Traces rays through mirrors and glass, at each vertex along the branch with the larger throughput, to the first
// surface of another kind. Replaces the guides of these pixels: the normal of that surface, and the position of its
// virtual image.
ARHOST_INLINE void store_seen(const Work &work, RTCRayHit16 rays, Vec3 direction, int first_pixel, Bool specular) {
    const Frame &frame = work.frame;
    const Scene &scene = frame.scene;
    Float travelled(0.0f);
    Vec3 towards = direction;
    constexpr int most_bounces = 8;
    for (int bounce = 0; bounce < most_bounces && any(specular); ++bounce) {
        const Surface s = surface_at(scene, rays, specular);
        travelled = travelled + s.distance;
        Bool arrived = specular;
        Vec3 origin = s.position, next = towards;
        if (s.any_translucent) {
            const Bool passes = specular & (s.opacity < Float(0.5f));
            origin = select(passes, s.position - s.geometric_normal * s.offset, origin);
            arrived = arrived & ~passes;
        }
        for_each_object(scene, rays.hit, specular, [&](const Object &object, Bool here) {
            const arhost_material &material = *object.material;
            const Vec3 above = s.position + s.geometric_normal * s.offset;
            if (material.model == ARHOST_MATERIAL_MIRROR) {
                origin = select(here, above, origin);
                next = select(here, reflected(s, towards), next);
                arrived = arrived & ~here;
            } else if ((material.model == ARHOST_MATERIAL_GLASS && material.roughness == 0) ||
                       material.transmission > 0) {
                const Bool passes =
                    here & ((s.transmission > Float(0.5f)) | bool_of(material.model == ARHOST_MATERIAL_GLASS));
                Glass glass = glass_of(material, s);
                glass.is_rough = false;
                const GlassScatter scatter = scatter_at_glass(s, towards, glass, {Float(0.0f), Float(0.0f)}, passes);
                const Bool reflects = passes & (scatter.reflectance > Float(0.5f));
                origin = select(passes, select(reflects, above, s.position - s.geometric_normal * s.offset), origin);
                next = select(passes, select(reflects, scatter.reflected, scatter.refracted), next);
                arrived = arrived & ~passes;
            }
        });
        if (any(arrived)) {
            const Int mirror = bits_of(load(work.scratch.guide[surface_guide] + first_pixel));
            const Int seen = object_number(scene, rays.hit) & Int(1023);
            put_guides(work, first_pixel,
                       {splat(frame.camera.eye) + direction * travelled, s.normal, white() /* Scratch::seen */,
                        mirror + (seen + Int(1)) * Int(mirrored_unit)},
                       arrived);
        }
        specular = specular & ~arrived;
        towards = normalize(next);
        set_ray(rays.ray, origin, towards, Float(far_away), Int(all_masks), Int(ray_of_eye));
        specular = trace(scene, scene.root, make_query(Coherence::incoherent), rays, specular);
    }
}

// Stores what the rays through the centres of a block's pixels meet.
ARHOST_INLINE void store_guides(const Work &work, const PrimaryHits &hits, Vec3 direction, int first_pixel) {
    const Scene &scene = work.frame.scene;
    const auto put = [&](const RTCRayHit16 &rays, Bool active, bool is_real) __attribute__((always_inline)) {
        const Surface s = surface_at(scene, rays, active);
        const Vec3 albedo = is_real ? white() : divisor_of(s);
        put_guides(work, first_pixel, {s.position, s.normal, albedo, surface_of(scene, rays.hit, active)}, active);
    };
    if (any(hits.caught))
        put(hits.catcher_rays, hits.caught, true);
    if (!any(hits.is_virtual))
        return;
    put(hits.rays, hits.is_virtual, false);
    const Bool specular =
        hits.is_virtual & is_kind(bits_of(load(work.scratch.guide[surface_guide] + first_pixel)), specular_surface);
    if (any(specular))
        store_seen(work, hits.rays, normalize(direction), first_pixel, specular);
}
