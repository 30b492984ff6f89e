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
    Vec3 sheen; // of fibres
    Float sheen_roughness;
    // Valid if any_anisotropic: unit vectors, orthogonal to `normal`, and the GGX roughness parameter along
    // `tangent`; `alpha` is along `bitangent`.
    Vec3 tangent, bitangent;
    Float tangent_alpha;
    Bool is_lit;   // shaded by direct light: neither a mirror nor glass nor unlit
    Bool is_unlit; // only `emission` is seen
    Bool is_rough; // has a metallic-roughness material; `specular` is then the reflectance at normal incidence
    Bool is_real;  // a catcher or occluder
    // Whether any lane has the property. A surface with any_scattering spawns secondary rays.
    bool any_specular, any_rough, any_scattering, any_translucent, any_transmission, any_coat, any_sheen,
        any_anisotropic;
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
// ARHOST_NONE. `footprint`: result of footprint_of(), or 0.
ARHOST_INLINE Texel sample_object_texture(const Scene &scene, const Object &object, std::uint32_t texture,
                                          const RTCHit16 &hit, Bool here, Float footprint) {
    if (!object.texcoords)
        return {white(), Float(1.0f)};
    const Corners corners = corners_of(object, hit, here);
    Float u = 0.0f, v = 0.0f;
    Texcoord at[3];
    for (int i = 0; i < 3; ++i) {
        at[i] = texcoord_of(object, scene.textures[texture], corners.vertex[i]);
        u = u + at[i].u * corners.weight[i];
        v = v + at[i].v * corners.weight[i];
    }
    const Float area = abs((at[1].u - at[0].u) * (at[2].v - at[0].v) - (at[2].u - at[0].u) * (at[1].v - at[0].v));
    return sample_texture(scene.linear_of_srgb8, scene.textures[texture], u, v, area * footprint);
}

// Returns the area that a sample from the eye covers on the triangles, as a multiple of half the area of the
// triangle. `distance`: from the eye, mm; `facet`: the geometric normal and `direction`: of the ray, of any length.
ARHOST_INLINE Float footprint_of(const Scene &scene, const Object &object, const RTCHit16 &hit, Bool here,
                                 Float distance, Vec3 facet, Vec3 direction) {
    if (!object.texcoords || scene.ray_angle == 0)
        return Float(0.0f);
    const Float facing = dot(normalize_or(facet, -direction), normalize(direction));
    const Corners corners = corners_of(object, hit, here);
    Vec3 position[3];
    for (int i = 0; i < 3; ++i)
        position[i] = gather_vector(object.positions, object.position_stride, corners.vertex[i]);
    Vec3 edge_1 = position[1] - position[0], edge_2 = position[2] - position[0];
    if (object.has_transform) {
        edge_1 = transform(object.transform, edge_1);
        edge_2 = transform(object.transform, edge_2);
    }
    const Float width = distance * Float(scene.ray_angle);
    return width * width / max(length(cross(edge_1, edge_2)) * max(abs(facing), Float(0.01f)), Float(1e-30f));
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

// The directions in which the texture coordinates u and v increase, not of unit length.
struct Tangents {
    Vec3 along_u, along_v;
};

// Returns the interpolated tangents of the vertices; if there are none, those of the triangles. `lookup`: the texture
// that has the texture coordinates. The object must have texture coordinates or tangents.
ARHOST_INLINE Tangents tangents_of(const Object &object, const Texture &lookup, const RTCHit16 &hit, Bool here) {
    const Corners corners = corners_of(object, hit, here);
    if (object.tangents) {
        Tangents sum{black(), black()};
        for (int i = 0; i < 3; ++i) {
            const Vec3 along = gather_vector(object.tangents, object.tangent_stride, corners.vertex[i]) *
                               corners.weight[i],
                       normal = gather_vector(object.normals, object.normal_stride, corners.vertex[i]);
            const Float side =
                gather(object.tangents + 3, corners.vertex[i] * Int(static_cast<int>(object.tangent_stride / 4)));
            sum.along_u = sum.along_u + along;
            sum.along_v = sum.along_v - cross(normal, along) * side;
        }
        return sum;
    }
    Vec3 position[3];
    Float u[3], v[3];
    for (int i = 0; i < 3; ++i) {
        position[i] = gather_vector(object.positions, object.position_stride, corners.vertex[i]);
        const Texcoord at = texcoord_of(object, lookup, corners.vertex[i]);
        u[i] = at.u;
        v[i] = at.v;
    }
    const Vec3 edge_1 = position[1] - position[0], edge_2 = position[2] - position[0];
    const Float u1 = u[1] - u[0], u2 = u[2] - u[0], v1 = v[1] - v[0], v2 = v[2] - v[0];
    return {tangent_along_u(edge_1, edge_2, u1, u2, v1, v2), tangent_along_v(edge_1, edge_2, u1, u2, v1, v2)};
}

ARHOST_INLINE Tangents tangents_in_world(const Object &object, const Texture &lookup, const RTCHit16 &hit,
                                         Bool here) {
    const Tangents t = tangents_of(object, lookup, hit, here);
    return object.has_transform
               ? Tangents{transform(object.transform, t.along_u), transform(object.transform, t.along_v)}
               : t;
}

// Returns `normal`, perturbed by a normal map. `facet` is the geometric normal. `texture`: an index; `scale`: of the
// perturbation; `footprint`: as in sample_object_texture().
ARHOST_INLINE Vec3 mapped_normal(const Scene &scene, const Object &object, std::uint32_t texture, float scale,
                                 Vec3 facet, Vec3 normal, const RTCHit16 &hit, Bool here, Float footprint) {
    const Tangents tangents = tangents_in_world(object, scene.textures[texture], hit, here);
    const Vec3 texel = sample_object_texture(scene, object, texture, hit, here, footprint).colour;
    return perturbed_normal(normal, facet, tangents.along_u, tangents.along_v, texel, Float(scale));
}

// An anisotropic material at the hits: the direction of its texture, in units of the tangents, and its strength.
struct Anisotropy {
    Float along_u, along_v, strength;
};
ARHOST_INLINE Anisotropy anisotropy_of(const Scene &scene, const Object &object, const RTCHit16 &hit, Bool here,
                                       Float footprint) {
    const arhost_material &material = *object.material;
    const Float c = material.anisotropy_direction[0], s = material.anisotropy_direction[1];
    Float x = 1.0f, y = 0.0f, strength = material.anisotropy;
    if (material.anisotropy_texture != ARHOST_NONE) {
        const Vec3 texel =
            sample_object_texture(scene, object, material.anisotropy_texture, hit, here, footprint).colour;
        x = texel.x * Float(2.0f) - Float(1.0f);
        y = texel.y * Float(2.0f) - Float(1.0f);
        strength = strength * texel.z;
    }
    return {x * c - y * s, -(x * s + y * c), strength}; // the second axis of the texture is along −v
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

// Makes the tangents of an anisotropic surface orthogonal to its normal.
ARHOST_INLINE void turn_tangents(Surface &s) {
    s.tangent = tangent_of(s.normal, s.tangent, tangent_axis(s.normal));
    s.bitangent = cross(s.normal, s.tangent);
}

// Replaces the reflectances of the share `film` of a surface by those under a thin film. `cosine`: of the angle
// between the normal and the eye, whose film all microfacets have.
ARHOST_INLINE void add_film(Surface &s, Float film, Float index, Float thickness_nm, Float cosine) {
    const auto under_film = [&](Vec3 f0, Float f90) {
        const Vec3 seen = film_reflectance(f0, index, thickness_nm, cosine);
        const Vec3 inverse{schlick_inverse(seen.x, f90, cosine), schlick_inverse(seen.y, f90, cosine),
                           schlick_inverse(seen.z, f90, cosine)};
        return f0 + (inverse - f0) * film;
    };
    s.specular = under_film(s.specular, s.edge_reflectance);
    s.dielectric = under_film(s.dielectric, s.dielectric_edge);
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
    s.coat_alpha = s.sheen_roughness = Float(1.0f);
    s.sheen = s.tangent = s.bitangent = black();
    s.tangent_alpha = Float(0.0f);
    s.any_sheen = s.any_anisotropic = false;
    bool any_film = false;
    Float film = 0.0f, film_index = 1.0f, film_nm = 0.0f;
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
        const Float footprint = footprint_of(scene, object, hit, here, s.distance, geometric, direction);
        if (object.material->model == ARHOST_MATERIAL_METALLIC_ROUGHNESS &&
            object.material->normal_texture != ARHOST_NONE && object.texcoords)
            normal = mapped_normal(scene, object, object.material->normal_texture, object.material->normal_scale,
                                   geometric, normal, hit, here, footprint);
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
            const Texel texel = sample_object_texture(scene, object, material.colour_texture, hit, here, footprint);
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
                sample_object_texture(scene, object, material.occlusion_texture, hit, here, footprint).colour.x;
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
                    sample_object_texture(scene, object, material.metallic_roughness_texture, hit, here, footprint)
                        .colour;
                metallic = metallic * factors.z;
                roughness = roughness * factors.y;
            }
            Float weight = material.specular_weight;
            if (material.specular_texture != ARHOST_NONE)
                weight = weight *
                         sample_object_texture(scene, object, material.specular_texture, hit, here, footprint).alpha;
            Vec3 dielectric = splat(material.specular) * normal_reflectance(Float(material.index));
            if (material.specular_colour_texture != ARHOST_NONE)
                dielectric = dielectric * sample_object_texture(scene, object, material.specular_colour_texture, hit,
                                                                here, footprint)
                                              .colour;
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
                    transmission = transmission * sample_object_texture(scene, object, material.transmission_texture,
                                                                        hit, here, footprint)
                                                      .colour.x;
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
                        coat * sample_object_texture(scene, object, material.clearcoat_texture, hit, here, footprint)
                                   .colour.x;
                if (material.clearcoat_roughness_texture != ARHOST_NONE)
                    coat_roughness =
                        coat_roughness * sample_object_texture(scene, object, material.clearcoat_roughness_texture,
                                                               hit, here, footprint)
                                             .colour.y;
                Vec3 coat_normal = vertex_normal;
                if (material.clearcoat_normal_texture != ARHOST_NONE && object.texcoords)
                    coat_normal =
                        mapped_normal(scene, object, material.clearcoat_normal_texture,
                                      material.clearcoat_normal_scale, geometric, coat_normal, hit, here, footprint);
                s.coat = select(here, coat, s.coat);
                s.coat_alpha = select(here, ggx_alpha(coat_roughness), s.coat_alpha);
                s.coat_normal = select(here, coat_normal, s.coat_normal);
                s.any_coat = true;
            }
            if (object.has_sheen) {
                Vec3 sheen = splat(material.sheen);
                Float sheen_roughness = material.sheen_roughness;
                if (material.sheen_texture != ARHOST_NONE)
                    sheen = sheen *
                            sample_object_texture(scene, object, material.sheen_texture, hit, here, footprint).colour;
                if (material.sheen_roughness_texture != ARHOST_NONE)
                    sheen_roughness =
                        sheen_roughness *
                        sample_object_texture(scene, object, material.sheen_roughness_texture, hit, here, footprint)
                            .alpha;
                s.sheen = select(here, sheen, s.sheen);
                s.sheen_roughness = select(here, sheen_roughness_of(sheen_roughness), s.sheen_roughness);
                s.any_sheen = true;
            }
            if (object.is_anisotropic && (object.texcoords || object.tangents)) {
                const Anisotropy anisotropy = anisotropy_of(scene, object, hit, here, footprint);
                const Texture plain{};
                const Tangents tangents = tangents_in_world(
                    object,
                    material.anisotropy_texture != ARHOST_NONE ? scene.textures[material.anisotropy_texture] : plain,
                    hit, here);
                const Vec3 along_u = normalize_or(tangents.along_u, black()),
                           along_v = normalize_or(tangents.along_v, black());
                const Float across = ggx_alpha(roughness);
                s.tangent = select(here, along_u * anisotropy.along_u + along_v * anisotropy.along_v, s.tangent);
                s.tangent_alpha =
                    select(here, across + anisotropy.strength * anisotropy.strength * (Float(1.0f) - across),
                           s.tangent_alpha);
                s.any_anisotropic = true;
            }
            if (object.has_film) {
                Float share = material.iridescence, thickness_nm = material.iridescence_thickness_nm[1];
                if (material.iridescence_texture != ARHOST_NONE)
                    share = share *
                            sample_object_texture(scene, object, material.iridescence_texture, hit, here, footprint)
                                .colour.x;
                if (material.iridescence_thickness_texture != ARHOST_NONE) {
                    const Float least = material.iridescence_thickness_nm[0];
                    thickness_nm =
                        least + (thickness_nm - least) * sample_object_texture(scene, object,
                                                                               material.iridescence_thickness_texture,
                                                                               hit, here, footprint)
                                                             .colour.y;
                }
                film = select(here, share, film);
                film_index = select(here, Float(material.iridescence_index), film_index);
                film_nm = select(here, thickness_nm, film_nm);
                any_film = true;
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
                    emission *
                    sample_object_texture(scene, object, material.emission_texture, hit, here, footprint).colour;
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
    if (s.any_anisotropic) {
        s.tangent_alpha = max(s.tangent_alpha, s.alpha);
        turn_tangents(s);
    }
    if (any_film)
        add_film(s, film, film_index, film_nm, -dot(s.normal, normalize(direction)));
    return s;
}
