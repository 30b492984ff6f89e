// SPDX-License-Identifier: Apache-2.0
//
// Computes what shading needs to know about the surfaces that a packet of rays hits.
#pragma once
#include "trace.inl"

#include "raytracer_common/packets/texture.inl"

struct Surface {
    Vec3 position;
    // The triangle's normal and the shading normal (interpolated from the vertices, and perturbed by the normal map).
    // Both have unit length and face the ray origin.
    Vec3 geometric_normal, normal;
    Bool back_face; // the ray hit the back face; `geometric_normal` has been flipped
    Float offset;   // mm: distance of a secondary ray's origin from the surface
    Vec3 lift;      // mm: vector from the hit to the curved surface where shadow rays start (lift_to_corner)
    Float distance; // mm, from the ray origin
    Vec3 ambient, diffuse, specular, emission;
    Float exponent;         // Phong exponent
    Float alpha;            // GGX roughness parameter; valid if `is_rough`
    Float edge_reflectance; // of a rough surface at grazing incidence
    Float opacity;          // < 1: blended with what is behind it
    Float transmission;     // the share of the surface that is glass, tinted by `transmitted`
    Vec3 transmitted;
    Float coat, coat_alpha; // share of a clear coat, and its GGX roughness parameter
    Vec3 coat_normal;
    Bool is_lit;   // shaded by direct light: neither a mirror nor glass nor unlit
    Bool is_unlit; // only `emission` is seen
    Bool is_rough; // has a metallic-roughness material; `specular` is then the reflectance at normal incidence
    Bool is_real;  // a catcher or occluder
    // Whether any lane has the property. A surface with any_scattering spawns secondary rays.
    bool any_specular, any_rough, any_scattering, any_translucent, any_transmission, any_coat;
    // The reflectance of the non-metallic part of a rough surface, at normal and at grazing incidence. The light that
    // it does not reflect reaches the diffuse layer.
    Vec3 dielectric;
    Float dielectric_edge;
};

// Returns the share of the light that passes to the diffuse layer of a rough surface.
ARHOST_INLINE Vec3 passing_fresnel(const Surface &s, Float cosine) {
    return white() - schlick_between(s.dielectric, s.dielectric_edge, cosine);
}

// Fresnel's reflectance of a rough surface.
ARHOST_INLINE Vec3 fresnel_of(const Surface &s, Float cosine) {
    return schlick_between(s.specular, s.edge_reflectance, cosine);
}

// The corners of the triangles hit: their vertices, and the barycentric coordinates of the hits.
struct Corners {
    Int vertex[3];
    Float weight[3];
};
// Lanes outside `here` yield the corners of triangle 0, which the caller ignores.
ARHOST_INLINE Corners corners_of(const Object &object, const RTCHit16 &hit, Bool here) {
    const Int first = select(here, load(hit.primID), Int(0)) * Int(static_cast<int>(object.index_stride / 4));
    const Float u = load(hit.u), v = load(hit.v);
    return {{gather(object.indices, first), gather(object.indices + 1, first), gather(object.indices + 2, first)},
            {Float(1.0f) - u - v, u, v}};
}

// `stride` is in bytes and a multiple of 4 (arhost/scene.h).
ARHOST_INLINE Vec3 gather_vector(const float *values, std::uint32_t stride, Int vertex) {
    const Int at = vertex * Int(static_cast<int>(stride / 4));
    return {gather(values, at), gather(values + 1, at), gather(values + 2, at)};
}

// Where a texture is looked up at a vertex.
struct Texcoord {
    Float u, v;
};
ARHOST_INLINE Texcoord texcoord_of(const Object &object, const Texture &texture, Int vertex) {
    const std::uint32_t stride = object.texcoord_stride / 4;
    const float *set = object.texcoords + std::size_t{texture.texcoord_set} * object.vertex_count * stride;
    const Int at = vertex * Int(static_cast<int>(stride));
    const Float s = gather(set, at), t = gather(set + 1, at);
    const float *m = texture.image_from_texcoord;
    return {s * Float(m[0]) + t * Float(m[2]) + Float(m[4]), s * Float(m[1]) + t * Float(m[3]) + Float(m[5])};
}

// Samples a texture at the hits; returns white if the object has no texture coordinates. `texture`: an index, not
// ARHOST_NONE.
ARHOST_INLINE Texel sample_object_texture(const Scene &scene, const Object &object, std::uint32_t texture,
                                          const RTCHit16 &hit, Bool here) {
    if (!object.texcoords)
        return {white(), Float(1.0f)};
    const Corners corners = corners_of(object, hit, here);
    Float u = 0.0f, v = 0.0f;
    for (int i = 0; i < 3; ++i) {
        const Texcoord at = texcoord_of(object, scene.textures[texture], corners.vertex[i]);
        u = u + at.u * corners.weight[i];
        v = v + at.v * corners.weight[i];
    }
    return sample_texture(scene.linear_of_srgb8, scene.textures[texture], u, v);
}

// Returns the linear colour and the opacity of the vertices at the hits; white if the object has none.
ARHOST_INLINE Texel vertex_colour(const Object &object, const RTCHit16 &hit, Bool here) {
    if (!object.colours)
        return {white(), Float(1.0f)};
    const Corners corners = corners_of(object, hit, here);
    Float sum[4] = {0.0f, 0.0f, 0.0f, 0.0f};
    for (int i = 0; i < 3; ++i) {
        const Int at = corners.vertex[i] * Int(static_cast<int>(object.colour_stride / 4));
        const Float weight = corners.weight[i] * Float(1.0f / 65535);
        for (int pair = 0; pair < 2; ++pair) {
            const Int codes = gather(object.colours + pair, at);
            sum[2 * pair] = sum[2 * pair] + to_float(codes & Int(65535)) * weight;
            sum[2 * pair + 1] = sum[2 * pair + 1] + to_float(shift_right_unsigned(codes, 16)) * weight;
        }
    }
    return {{sum[0], sum[1], sum[2]}, sum[3]};
}

// Returns `normal`, perturbed by a normal map. `facet` is the geometric normal. The tangents are constant over each
// triangle. `texture`: an index; `scale`: of the perturbation.
ARHOST_INLINE Vec3 mapped_normal(const Scene &scene, const Object &object, std::uint32_t texture, float scale,
                                 Vec3 facet, Vec3 normal, const RTCHit16 &hit, Bool here) {
    const Corners corners = corners_of(object, hit, here);
    Vec3 position[3];
    Float u[3], v[3];
    for (int i = 0; i < 3; ++i) {
        position[i] = gather_vector(object.positions, object.position_stride, corners.vertex[i]);
        const Texcoord at = texcoord_of(object, scene.textures[texture], corners.vertex[i]);
        u[i] = at.u;
        v[i] = at.v;
    }
    const Vec3 edge_1 = position[1] - position[0], edge_2 = position[2] - position[0];
    const Float u1 = u[1] - u[0], u2 = u[2] - u[0], v1 = v[1] - v[0], v2 = v[2] - v[0];
    Vec3 along_u = tangent_along_u(edge_1, edge_2, u1, u2, v1, v2);
    Vec3 along_v = tangent_along_v(edge_1, edge_2, u1, u2, v1, v2);
    if (object.has_transform) {
        along_u = transform(object.transform, along_u);
        along_v = transform(object.transform, along_v);
    }
    const Vec3 texel = sample_object_texture(scene, object, texture, hit, here).colour;
    return perturbed_normal(normal, facet, along_u, along_v, texel, Float(scale));
}

// Returns the vectors, in object space, from the hits to the curved surface that the vertex normals describe
// (lift_to_corner). `side`: −1 in lanes whose rays come from the side opposite to the vertex normals, else 1.
ARHOST_INLINE Vec3 lift_of(const Object &object, const Corners &corners, const Vec3 (&normals)[3], Float side) {
    Vec3 positions[3], hit = black(), lift = black();
    for (int i = 0; i < 3; ++i) {
        positions[i] = gather_vector(object.positions, object.position_stride, corners.vertex[i]);
        hit = hit + positions[i] * corners.weight[i];
    }
    for (int i = 0; i < 3; ++i)
        lift = lift + lift_to_corner(positions[i] - hit, normals[i] * side) * corners.weight[i];
    return lift;
}

// Fresnel's reflectance of a clear coat, of index 1.5.
ARHOST_INLINE Float coat_reflectance(Float cosine) {
    const Float normal_incidence(0.04f);
    return schlick({normal_incidence, normal_incidence, normal_incidence}, cosine).x;
}

// Returns the share of the light to the eye that passes the clear coat.
ARHOST_INLINE Float below_coat(const Surface &s, Vec3 to_eye) {
    return Float(1.0f) - s.coat * coat_reflectance(dot(s.coat_normal, to_eye));
}

ARHOST_INLINE Surface surface_at(const Scene &scene, const RTCRayHit16 &rays, Bool active) {
    const RTCHit16 &hit = rays.hit;
    const Vec3 direction = direction_of(rays.ray);
    const Vec3 facet{load(hit.Ng_x), load(hit.Ng_y), load(hit.Ng_z)};
    const Vec3 step = direction * load(rays.ray.tfar);

    Surface s; // without `= {}`, which GCC compiles to a slow string instruction
    s.ambient = s.diffuse = s.specular = s.emission = s.lift = black();
    s.exponent = s.alpha = Float(0.0f);
    s.edge_reflectance = s.opacity = s.dielectric_edge = Float(1.0f);
    s.dielectric = black();
    s.is_lit = s.is_unlit = s.is_rough = s.is_real = bool_of(false);
    s.any_specular = s.any_rough = s.any_scattering = s.any_translucent = s.any_transmission = s.any_coat = false;
    s.transmission = s.coat = Float(0.0f);
    s.transmitted = black();
    s.coat_alpha = Float(1.0f);
    s.position = origin_of(rays.ray) + step;
    s.distance = length(step);
    s.geometric_normal = facet;
    s.normal = s.coat_normal = facet;
    Vec3 extent = black();
    for_each_object(scene, hit, active, [&](const Object &object, Bool here) {
        Vec3 geometric = facet, normal = facet;
        Corners corners;
        Vec3 normals[3];
        if (object.normals) {
            corners = corners_of(object, hit, here);
            normal = black();
            for (int i = 0; i < 3; ++i) {
                normals[i] = gather_vector(object.normals, object.normal_stride, corners.vertex[i]);
                normal = normal + normals[i] * corners.weight[i];
            }
        }
        if (object.has_transform) {
            geometric = transform(object.normal_transform, geometric);
            normal = transform(object.normal_transform, normal);
        }
        const Vec3 vertex_normal = normal;
        if (object.material->model == ARHOST_MATERIAL_METALLIC_ROUGHNESS &&
            object.material->normal_texture != ARHOST_NONE && object.texcoords)
            normal = mapped_normal(scene, object, object.material->normal_texture, object.material->normal_scale,
                                   geometric, normal, hit, here);
        extent = select(here, splat(object.extent), extent);
        s.geometric_normal = select(here, geometric, s.geometric_normal);
        s.normal = select(here, normal, s.normal);
        if (object.role != ARHOST_ROLE_VIRTUAL)
            s.is_real = s.is_real | here;

        const arhost_material &material = *object.material;
        s.any_scattering |= material.model >= ARHOST_MATERIAL_MIRROR;
        if (material.model == ARHOST_MATERIAL_MIRROR || material.model == ARHOST_MATERIAL_GLASS)
            return;
        const bool is_unlit = material.model == ARHOST_MATERIAL_UNLIT;
        (is_unlit ? s.is_unlit : s.is_lit) = (is_unlit ? s.is_unlit : s.is_lit) | here;
        if (object.normals && !is_unlit) {
            const Bool from_behind = dot(vertex_normal, geometric) * dot(geometric, direction) > Float(0.0f);
            const Vec3 lift = lift_of(object, corners, normals, select(from_behind, Float(-1.0f), Float(1.0f)));
            s.lift = select(here, object.has_transform ? transform(object.transform, lift) : lift, s.lift);
        }
        Vec3 ambient = splat(material.ambient), diffuse = splat(material.diffuse);
        Float opacity = material.opacity;
        if (material.colour_texture != ARHOST_NONE) {
            const Texel texel = sample_object_texture(scene, object, material.colour_texture, hit, here);
            ambient = ambient * texel.colour;
            diffuse = diffuse * texel.colour;
            opacity = opacity * texel.alpha;
        }
        if (object.colours) {
            const Texel colour = vertex_colour(object, hit, here);
            ambient = ambient * colour.colour;
            diffuse = diffuse * colour.colour;
            opacity = opacity * colour.alpha;
        }
        if (object.blends) {
            s.opacity = select(here, min(opacity, Float(1.0f)), s.opacity);
            s.any_translucent = true;
        }
        if (is_unlit) {
            s.emission = select(here, diffuse, s.emission);
            return;
        }
        if (material.model == ARHOST_MATERIAL_METALLIC_ROUGHNESS && material.occlusion_texture != ARHOST_NONE &&
            scene.has_ambient) {
            const Float occlusion =
                sample_object_texture(scene, object, material.occlusion_texture, hit, here).colour.x;
            ambient = ambient * (Float(1.0f) + (occlusion - Float(1.0f)) * Float(material.occlusion_strength));
        }
        if (material.model == ARHOST_MATERIAL_SPECULAR || material.model == ARHOST_MATERIAL_METAL) {
            s.specular = select(here, splat(material.specular), s.specular);
            s.exponent = select(here, Float(material.exponent), s.exponent);
            s.any_specular = true;
        }
        if (material.model == ARHOST_MATERIAL_METALLIC_ROUGHNESS) {
            Float metallic = material.metallic, roughness = material.roughness;
            if (material.metallic_roughness_texture != ARHOST_NONE) {
                const Vec3 factors =
                    sample_object_texture(scene, object, material.metallic_roughness_texture, hit, here).colour;
                metallic = metallic * factors.z;
                roughness = roughness * factors.y;
            }
            Float weight = material.specular_weight;
            if (material.specular_texture != ARHOST_NONE)
                weight = weight * sample_object_texture(scene, object, material.specular_texture, hit, here).alpha;
            Vec3 dielectric = splat(material.specular) * normal_reflectance(Float(material.index));
            if (material.specular_colour_texture != ARHOST_NONE)
                dielectric = dielectric *
                             sample_object_texture(scene, object, material.specular_colour_texture, hit, here).colour;
            dielectric =
                Vec3{min(dielectric.x, Float(1.0f)), min(dielectric.y, Float(1.0f)), min(dielectric.z, Float(1.0f))} *
                weight;
            s.dielectric = select(here, dielectric, s.dielectric);
            s.dielectric_edge = select(here, weight, s.dielectric_edge);
            s.specular = select(here, metallic_reflectance(dielectric, diffuse, metallic), s.specular);
            s.edge_reflectance = select(here, weight + (Float(1.0f) - weight) * metallic, s.edge_reflectance);
            s.alpha = select(here, ggx_alpha(roughness), s.alpha);
            if (material.transmission > 0) {
                Float transmission = (Float(1.0f) - metallic) * Float(material.transmission);
                if (material.transmission_texture != ARHOST_NONE)
                    transmission =
                        transmission *
                        sample_object_texture(scene, object, material.transmission_texture, hit, here).colour.x;
                s.transmission = select(here, transmission, s.transmission);
                s.transmitted = select(
                    here, material.thin_walled ? diffuse : Vec3{sqrt(diffuse.x), sqrt(diffuse.y), sqrt(diffuse.z)},
                    s.transmitted);
                s.any_transmission = true;
            }
            if (object.has_coat) {
                Float coat = material.clearcoat, coat_roughness = material.clearcoat_roughness;
                if (material.clearcoat_texture != ARHOST_NONE)
                    coat =
                        coat * sample_object_texture(scene, object, material.clearcoat_texture, hit, here).colour.x;
                if (material.clearcoat_roughness_texture != ARHOST_NONE)
                    coat_roughness =
                        coat_roughness *
                        sample_object_texture(scene, object, material.clearcoat_roughness_texture, hit, here)
                            .colour.y;
                Vec3 coat_normal = vertex_normal;
                if (material.clearcoat_normal_texture != ARHOST_NONE && object.texcoords)
                    coat_normal = mapped_normal(scene, object, material.clearcoat_normal_texture,
                                                material.clearcoat_normal_scale, geometric, coat_normal, hit, here);
                s.coat = select(here, coat, s.coat);
                s.coat_alpha = select(here, ggx_alpha(coat_roughness), s.coat_alpha);
                s.coat_normal = select(here, coat_normal, s.coat_normal);
                s.any_coat = true;
            }
            s.is_rough = s.is_rough | here;
            s.any_rough = true;
            ambient = metallic_diffuse(ambient, metallic);
            diffuse = metallic_diffuse(diffuse, metallic);
        }
        s.ambient = select(here, ambient, s.ambient);
        s.diffuse = select(here, diffuse, s.diffuse);
        if (material.emission[0] + material.emission[1] + material.emission[2] > 0) {
            Vec3 emission = splat(material.emission);
            if (material.emission_texture != ARHOST_NONE)
                emission =
                    emission * sample_object_texture(scene, object, material.emission_texture, hit, here).colour;
            s.emission = select(here, emission, s.emission);
        }
    });

    s.geometric_normal = normalize_or(s.geometric_normal, -normalize(direction));
    s.offset = offset_from_surface(s.position, step, s.geometric_normal, extent);
    s.back_face = dot(s.geometric_normal, direction) > Float(0.0f);
    s.geometric_normal = facing(s.geometric_normal, -direction);
    s.normal = shading_normal(s.normal, s.geometric_normal);
    if (s.any_coat) {
        s.coat_normal = shading_normal(s.coat_normal, s.geometric_normal);
        s.emission = s.emission * below_coat(s, -normalize(direction));
    }
    return s;
}
