// SPDX-License-Identifier: Apache-2.0
//
// Computes what shading needs to know about the surface at a hit. Equivalent to rt_embree's kernel/surface.inl.

struct Surface {
    vec3 position;
    // The triangle's normal and the shading normal (interpolated from the vertices, and perturbed by the normal map).
    // Both have unit length and face the ray origin.
    vec3 geometric_normal, normal;
    bool back_face; // the ray hit the back face; `geometric_normal` has been flipped
    float offset;      // mm: distance of a secondary ray's origin from the surface
    float distance;    // mm, from the ray origin
    vec3 lift;         // mm: vector from the hit to the curved surface where shadow rays start (lift_to_corner)
    bool is_real;      // a catcher or occluder
    // add_material() sets the following members. They are 0 for mirrors and glass.
    vec3 ambient, diffuse, specular, emission;
    float exponent; // Phong exponent
    float alpha;    // GGX roughness parameter; valid if `is_rough`
    bool is_rough;  // has a metallic-roughness material; `specular` is then the reflectance at normal incidence
    float edge_reflectance; // of a rough surface at grazing incidence
    float opacity;          // < 1: blended with what is behind it
    float transmission;     // the share of the surface that is glass, tinted by `transmitted`
    vec3 transmitted;
    float coat, coat_alpha; // share of a clear coat, and its GGX roughness parameter
    vec3 coat_normal;
    vec3 sheen; // of fibres
    float sheen_roughness;
    // Unit vectors, orthogonal to `normal`, and the GGX roughness parameter along `tangent`; `alpha` is along
    // `bitangent`.
    vec3 tangent, bitangent;
    float tangent_alpha;
    // The area that a sample from the eye covers, as a multiple of half the area of the triangle; 0: of no interest.
    float footprint;
    // The reflectance of the non-metallic part of a rough surface, at normal and at grazing incidence. The light that it
    // does not reflect reaches the diffuse layer.
    vec3 dielectric;
    float dielectric_edge;
};

// Returns the share of the light that passes to the diffuse layer of a rough surface.
vec3 passing_fresnel(Surface s, float cosine) {
    return vec3(1.0) - schlick_between(s.dielectric, s.dielectric_edge, cosine);
}

// Fresnel's reflectance of a rough surface.
vec3 fresnel_of(Surface s, float cosine) {
    return schlick_between(s.specular, s.edge_reflectance, cosine);
}

// Fresnel's reflectance of a clear coat, of index 1.5.
float coat_reflectance(float cosine) {
    return schlick(vec3(0.04), cosine).x;
}

// Returns the share of the light to the eye that passes the clear coat.
float below_coat(Surface s, vec3 to_eye) {
    return 1.0 - s.coat * coat_reflectance(dot(s.coat_normal, to_eye));
}

// Returns the share of the light to the eye that passes the fibres.
float below_sheen(Surface s, vec3 to_eye) {
    return 1.0 - largest(s.sheen) * sheen_albedo(dot(s.normal, to_eye), s.sheen_roughness);
}

// Bends the normals of a rough virtual surface so that it reflects the eye's rays away from the surface.
void bend_normals(inout Surface s, vec3 to_eye) {
    s.normal = reflecting_normal(s.normal, s.geometric_normal, to_eye);
    if (has_coat)
        s.coat_normal = reflecting_normal(s.coat_normal, s.geometric_normal, to_eye);
    if (is_anisotropic) {
        s.tangent = tangent_of(s.normal, s.tangent, tangent_axis(s.normal));
        s.bitangent = cross(s.normal, s.tangent);
    }
}

// Microfacets of a rough surface. Vectors are in world coordinates.
vec3 in_tangents(Surface s, vec3 a) {
    return vec3(dot(a, s.tangent), dot(a, s.bitangent), dot(a, s.normal));
}
vec3 half_vector_of(Surface s, vec3 to_eye, vec2 uv) {
    if (is_anisotropic)
        return anisotropic_half_vector(s.tangent, s.bitangent, s.normal, to_eye, s.tangent_alpha, s.alpha, uv.x, uv.y);
    return ggx_half_vector(s.normal, to_eye, s.alpha, uv.x, uv.y);
}
float reflection_density(Surface s, vec3 to_eye, vec3 half_vector) {
    if (is_anisotropic)
        return anisotropic_reflection_density(in_tangents(s, to_eye), in_tangents(s, half_vector), s.tangent_alpha,
                                              s.alpha);
    return ggx_reflection_density(dot(s.normal, to_eye), dot(s.normal, half_vector), s.alpha);
}
float rough_lobe(Surface s, vec3 to_eye, vec3 to_light, vec3 half_vector) {
    if (is_anisotropic)
        return anisotropic_lobe(in_tangents(s, to_light), in_tangents(s, to_eye), in_tangents(s, half_vector),
                                s.tangent_alpha, s.alpha);
    return ggx_lobe(lambert(s.normal, to_light), dot(s.normal, to_eye), dot(s.normal, half_vector), s.alpha);
}

vec3 normal_at(uint object, uint number, vec2 uv) {
    uint first = objects[object].first_index + 3u * number, base = objects[object].first_normal;
    vec3 weights = vec3(1.0 - uv.x - uv.y, uv.x, uv.y), sum = vec3(0.0);
    for (int i = 0; i < 3; ++i) {
        uint from = base + 3u * indices[first + uint(i)];
        sum += vec3(attributes[from], attributes[from + 1u], attributes[from + 2u]) * weights[i];
    }
    return sum;
}

// Returns the vector, in object space, from the hit to the curved surface that the vertex normals describe
// (lift_to_corner). `side`: −1 if the ray comes from the side opposite to the vertex normals, else 1.
vec3 lift_of(Hit hit, float side) {
    uint first = objects[hit.object].first_index + 3u * primitives[hit.primitive].number;
    vec3 weights = vec3(1.0 - hit.uv.x - hit.uv.y, hit.uv.x, hit.uv.y), lift = vec3(0.0);
    // The corners and the hit, relative to the first corner.
    vec3 corners[3] = vec3[](vec3(0.0), -primitives[hit.primitive].edge_1, primitives[hit.primitive].edge_2);
    vec3 position = corners[1] * weights.y + corners[2] * weights.z;
    for (int i = 0; i < 3; ++i) {
        uint from = objects[hit.object].first_normal + 3u * indices[first + uint(i)];
        vec3 normal = vec3(attributes[from], attributes[from + 1u], attributes[from + 2u]) * side;
        lift += lift_to_corner(corners[i] - position, normal) * weights[i];
    }
    return lift;
}

// Returns the directions in world space, not of unit length, in which the texture coordinates of a texture increase:
// interpolated from the vertices, or those of the triangle. `number`: of the texture; NONE: texcoord set 0 as it is.
void tangents_of(Hit hit, uint number, out vec3 along_u, out vec3 along_v) {
    uint object = hit.object, first = objects[object].first_index + 3u * primitives[hit.primitive].number;
    along_u = along_v = vec3(0.0);
    if (objects[object].first_tangent != NONE) {
        vec3 weights = vec3(1.0 - hit.uv.x - hit.uv.y, hit.uv.x, hit.uv.y);
        for (int i = 0; i < 3; ++i) {
            uint vertex = indices[first + uint(i)], from = objects[object].first_tangent + 4u * vertex;
            uint from_normal = objects[object].first_normal + 3u * vertex;
            vec3 along = vec3(attributes[from], attributes[from + 1u], attributes[from + 2u]) * weights[i];
            vec3 normal = vec3(attributes[from_normal], attributes[from_normal + 1u], attributes[from_normal + 2u]);
            along_u += along;
            along_v -= cross(normal, along) * attributes[from + 3u];
        }
    } else {
        vec2 texcoords[3];
        for (int i = 0; i < 3; ++i) {
            uint vertex = indices[first + uint(i)], from = objects[object].first_texcoord + 2u * vertex;
            texcoords[i] = number == NONE ? vec2(attributes[from], attributes[from + 1u])
                                          : texcoord_of(object, vertex, number);
        }
        vec3 edge_1 = -primitives[hit.primitive].edge_1, edge_2 = primitives[hit.primitive].edge_2;
        vec2 delta_1 = texcoords[1] - texcoords[0], delta_2 = texcoords[2] - texcoords[0];
        along_u = tangent_along_u(edge_1, edge_2, delta_1.x, delta_2.x, delta_1.y, delta_2.y);
        along_v = tangent_along_v(edge_1, edge_2, delta_1.x, delta_2.x, delta_1.y, delta_2.y);
    }
    if ((objects[object].flags & HAS_TRANSFORM) != 0u) {
        along_u = objects[object].transform * along_u;
        along_v = objects[object].transform * along_v;
    }
}

// Returns `normal`, perturbed by a normal texture. `facet` is the geometric normal. `number`: of the texture; `scale`: of
// the perturbation; `footprint`: as in Surface.
vec3 normal_mapped(Hit hit, uint number, float scale, vec3 facet, vec3 normal, float footprint) {
    vec3 along_u, along_v;
    tangents_of(hit, number, along_u, along_v);
    return perturbed_normal(normal, facet, along_u, along_v, texel_at_hit(hit, number, footprint).rgb, scale);
}

// See Surface.footprint. `distance`: from the eye, mm; `facing`: cosine of the angle between the ray and the normal.
float footprint_of(Hit hit, float distance, float facing) {
    if (!has_textures || objects[hit.object].first_texcoord == NONE || !(frame.ray_angle > 0.0))
        return 0.0;
    vec3 edge_1 = primitives[hit.primitive].edge_1, edge_2 = primitives[hit.primitive].edge_2;
    if ((objects[hit.object].flags & HAS_TRANSFORM) != 0u) {
        edge_1 = objects[hit.object].transform * edge_1;
        edge_2 = objects[hit.object].transform * edge_2;
    }
    float width = distance * frame.ray_angle;
    return width * width / max(length(cross(edge_1, edge_2)) * max(abs(facing), 0.01), 1e-30);
}

// Returns the surface at a hit, without material properties. `normal_maps`: whether to apply normal textures.
Surface surface_at(Ray ray, Hit hit, bool normal_maps) {
    uint object = hit.object, material = objects[object].material;
    precise vec3 path = ray.direction * hit.t;
    vec3 geometric = hit.facet, normal = hit.facet;
    if (objects[object].first_normal != NONE)
        normal = normal_at(object, primitives[hit.primitive].number, hit.uv);
    if ((objects[object].flags & HAS_TRANSFORM) != 0u) {
        geometric = objects[object].normal_transform * geometric;
        normal = objects[object].normal_transform * normal;
    }
    vec3 vertex_normal = normal, coat_normal = normal;
    float footprint = footprint_of(hit, length(path), dot(normalize_or(geometric, -path), normalize(path)));
    if (has_textures && normal_maps && materials[material].model == METALLIC_ROUGHNESS &&
        objects[object].first_texcoord != NONE)
        for (int i = 0; i < (has_coat ? 2 : 1); ++i) { // a loop rather than two calls, as in add_material()
            uint number = i == 0 ? materials[material].normal_texture : materials[material].clearcoat_normal_texture;
            if (number == NONE)
                continue;
            vec3 mapped = normal_mapped(hit, number,
                                        i == 0 ? materials[material].normal_scale
                                               : materials[material].clearcoat_normal_scale,
                                        geometric, vertex_normal, footprint);
            if (i == 0)
                normal = mapped;
            else
                coat_normal = mapped;
        }

    Surface s;
    s.footprint = footprint;
    s.position = ray.origin + path;
    s.distance = length(path);
    s.is_real = objects[object].role != VIRTUAL;
    s.geometric_normal = normalize_or(geometric, -normalize(ray.direction));
    s.offset = offset_from_surface(s.position, path, s.geometric_normal, objects[object].extent);
    s.back_face = dot(s.geometric_normal, ray.direction) > 0.0;
    s.geometric_normal = facing(s.geometric_normal, -ray.direction);
    s.normal = shading_normal(normal, s.geometric_normal);
    s.coat_normal = has_coat ? shading_normal(coat_normal, s.geometric_normal) : s.normal;
    s.lift = vec3(0.0);
    if (objects[object].first_normal != NONE && materials[material].model != MIRROR &&
        materials[material].model != GLASS && materials[material].model != UNLIT) {
        bool from_behind = dot(vertex_normal, geometric) * dot(geometric, ray.direction) > 0.0;
        s.lift = lift_of(hit, from_behind ? -1.0 : 1.0);
        if ((objects[object].flags & HAS_TRANSFORM) != 0u)
            s.lift = objects[object].transform * s.lift;
    }
    s.ambient = s.diffuse = s.specular = s.emission = vec3(0.0);
    s.exponent = s.alpha = s.transmission = s.coat = 0.0;
    s.edge_reflectance = s.opacity = s.coat_alpha = s.dielectric_edge = 1.0;
    s.dielectric = vec3(0.0);
    s.transmitted = s.sheen = s.tangent = s.bitangent = vec3(0.0);
    s.sheen_roughness = s.tangent_alpha = 1.0;
    s.is_rough = false;
    return s;
}

// Returns the reflectance at normal incidence of a surface under a thin film that gives Schlick's term the reflectance of
// the film at the angle of the eye. All microfacets have it. `f0`, `f90`: without the film.
vec3 under_film(vec3 f0, float f90, float index, float thickness_nm, float cosine) {
    vec3 seen = film_reflectance(f0, index, thickness_nm, cosine);
    return vec3(schlick_inverse(seen.x, f90, cosine), schlick_inverse(seen.y, f90, cosine),
                schlick_inverse(seen.z, f90, cosine));
}

// Sets the material properties of a surface that is neither a mirror nor glass. `to_eye`: unit vector.
void add_material(inout Surface s, Hit hit, vec3 to_eye) {
    uint material = objects[hit.object].material, model = materials[material].model;
    bool is_rough = model == METALLIC_ROUGHNESS;
    s.ambient = materials[material].ambient;
    s.diffuse = materials[material].diffuse;
    s.emission = materials[material].emission;
    s.opacity = materials[material].opacity;
    vec4 colour = vertex_colour(hit.object, primitives[hit.primitive].number, hit.uv);
    float metallic = materials[material].metallic, roughness = materials[material].roughness;
    float specular_weight = materials[material].specular_weight;
    vec3 dielectric = materials[material].specular;
    float transmission = materials[material].transmission;
    float coat = materials[material].clearcoat, coat_roughness = materials[material].clearcoat_roughness;
    float occlusion = 1.0;
    vec3 sheen = materials[material].sheen;
    float sheen_roughness = materials[material].sheen_roughness;
    vec3 anisotropy = vec3(1.0, 0.0, materials[material].anisotropy); // direction and strength
    float film = materials[material].iridescence, film_nm = materials[material].iridescence_thickness_nm.y;
    if (has_textures) {
        bool is_emissive = s.emission.x + s.emission.y + s.emission.z > 0.0;
        // A loop rather than calls, because texture sampling is inlined and its code is long.
        uint numbers[14] = uint[](materials[material].colour_texture, materials[material].metallic_roughness_texture,
                                 is_emissive ? materials[material].emission_texture : NONE,
                                 materials[material].specular_texture, materials[material].specular_colour_texture,
                                 materials[material].transmission_texture, materials[material].clearcoat_texture,
                                 materials[material].clearcoat_roughness_texture,
                                 materials[material].occlusion_texture,
                                 has_sheen ? materials[material].sheen_texture : NONE,
                                 has_sheen ? materials[material].sheen_roughness_texture : NONE,
                                 is_anisotropic ? materials[material].anisotropy_texture : NONE,
                                 has_film ? materials[material].iridescence_texture : NONE,
                                 has_film ? materials[material].iridescence_thickness_texture : NONE);
        for (int i = 0; i < 14; ++i) {
            if (numbers[i] == NONE || (!is_rough && i != 0 && i != 2))
                continue;
            vec4 texel = texel_at_hit(hit, numbers[i], s.footprint);
            if (i == 0) {
                colour *= texel;
            } else if (i == 1) {
                metallic *= texel.z;
                roughness *= texel.y;
            } else if (i == 2) {
                s.emission *= texel.rgb;
            } else if (i == 3) {
                specular_weight *= texel.a;
            } else if (i == 4) {
                dielectric *= texel.rgb;
            } else if (i == 5) {
                transmission *= texel.x;
            } else if (i == 6) {
                coat *= texel.x;
            } else if (i == 7) {
                coat_roughness *= texel.y;
            } else if (i == 8) {
                occlusion = 1.0 + (texel.x - 1.0) * materials[material].occlusion_strength;
            } else if (i == 9) {
                sheen *= texel.rgb;
            } else if (i == 10) {
                sheen_roughness *= texel.a;
            } else if (i == 11) {
                anisotropy = vec3(texel.xy * 2.0 - 1.0, anisotropy.z * texel.z);
            } else if (i == 12) {
                film *= texel.x;
            } else {
                film_nm = mix(materials[material].iridescence_thickness_nm.x, film_nm, texel.y);
            }
        }
    }
    s.diffuse *= colour.rgb;
    s.ambient *= colour.rgb * occlusion;
    s.opacity = min(s.opacity * colour.a, 1.0);
    if ((objects[hit.object].flags & BLENDS) == 0u)
        s.opacity = 1.0;
    if (model == UNLIT) {
        s.emission = s.diffuse;
        s.ambient = s.diffuse = vec3(0.0);
        return;
    }
    if (model == SPECULAR || model == METAL) {
        s.specular = materials[material].specular;
        s.exponent = materials[material].exponent;
    }
    if (is_rough) {
        dielectric = min(dielectric, 1.0) * specular_weight;
        s.dielectric = dielectric;
        s.dielectric_edge = specular_weight;
        s.specular = metallic_reflectance(dielectric, s.diffuse, metallic);
        s.edge_reflectance = specular_weight + (1.0 - specular_weight) * metallic;
        s.alpha = ggx_alpha(roughness);
        s.is_rough = true;
        s.transmission = transmission * (1.0 - metallic);
        s.transmitted = materials[material].thin_walled != 0u ? s.diffuse : sqrt(s.diffuse);
        s.ambient = metallic_diffuse(s.ambient, metallic);
        s.diffuse = metallic_diffuse(s.diffuse, metallic);
        if (has_coat && coat > 0.0) {
            s.coat = coat;
            s.coat_alpha = ggx_alpha(coat_roughness);
            s.emission *= below_coat(s, to_eye);
        }
        s.sheen = sheen;
        s.sheen_roughness = sheen_roughness_of(sheen_roughness);
        if (is_anisotropic) {
            s.tangent = vec3(0.0);
            s.tangent_alpha = s.alpha;
            if (objects[hit.object].first_texcoord != NONE || objects[hit.object].first_tangent != NONE) {
                vec3 along_u, along_v;
                tangents_of(hit, materials[material].anisotropy_texture, along_u, along_v);
                vec2 turn = materials[material].anisotropy_direction;
                // The second axis of the texture is along −v.
                s.tangent = normalize_or(along_u, vec3(0.0)) * (anisotropy.x * turn.x - anisotropy.y * turn.y) -
                            normalize_or(along_v, vec3(0.0)) * (anisotropy.x * turn.y + anisotropy.y * turn.x);
                s.tangent_alpha = mix(s.alpha, 1.0, anisotropy.z * anisotropy.z);
            }
            s.tangent = tangent_of(s.normal, s.tangent, tangent_axis(s.normal));
            s.bitangent = cross(s.normal, s.tangent);
        }
        if (has_film && film > 0.0) {
            float index = materials[material].iridescence_index, cosine = dot(s.normal, to_eye);
            s.specular = mix(s.specular, under_film(s.specular, s.edge_reflectance, index, film_nm, cosine), film);
            s.dielectric = mix(s.dielectric, under_film(s.dielectric, s.dielectric_edge, index, film_nm, cosine), film);
        }
    }
}
