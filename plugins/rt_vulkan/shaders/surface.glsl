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

// Returns `normal`, perturbed by a normal texture. `facet` is the geometric normal. The tangents are constant over each
// triangle. `number`: of the texture; `scale`: of the perturbation.
vec3 normal_mapped(Hit hit, uint number, float scale, vec3 facet, vec3 normal) {
    uint first = objects[hit.object].first_index + 3u * primitives[hit.primitive].number;
    vec2 texcoords[3];
    for (int i = 0; i < 3; ++i)
        texcoords[i] = texcoord_of(hit.object, indices[first + uint(i)], number);
    vec3 edge_1 = -primitives[hit.primitive].edge_1, edge_2 = primitives[hit.primitive].edge_2;
    vec2 delta_1 = texcoords[1] - texcoords[0], delta_2 = texcoords[2] - texcoords[0];
    vec3 along_u = tangent_along_u(edge_1, edge_2, delta_1.x, delta_2.x, delta_1.y, delta_2.y);
    vec3 along_v = tangent_along_v(edge_1, edge_2, delta_1.x, delta_2.x, delta_1.y, delta_2.y);
    if ((objects[hit.object].flags & HAS_TRANSFORM) != 0u) {
        along_u = objects[hit.object].transform * along_u;
        along_v = objects[hit.object].transform * along_v;
    }
    return perturbed_normal(normal, facet, along_u, along_v, texel_at_hit(hit, number).rgb, scale);
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
    if (has_textures && normal_maps && materials[material].model == METALLIC_ROUGHNESS &&
        objects[object].first_texcoord != NONE)
        for (int i = 0; i < (has_coat ? 2 : 1); ++i) { // a loop rather than two calls, as in add_material()
            uint number = i == 0 ? materials[material].normal_texture : materials[material].clearcoat_normal_texture;
            if (number == NONE)
                continue;
            vec3 mapped = normal_mapped(hit, number,
                                        i == 0 ? materials[material].normal_scale
                                               : materials[material].clearcoat_normal_scale,
                                        geometric, vertex_normal);
            if (i == 0)
                normal = mapped;
            else
                coat_normal = mapped;
        }

    Surface s;
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
    s.transmitted = vec3(0.0);
    s.is_rough = false;
    return s;
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
    if (has_textures) {
        bool is_emissive = s.emission.x + s.emission.y + s.emission.z > 0.0;
        // A loop rather than calls, because texture sampling is inlined and its code is long.
        uint numbers[9] = uint[](materials[material].colour_texture, materials[material].metallic_roughness_texture,
                                 is_emissive ? materials[material].emission_texture : NONE,
                                 materials[material].specular_texture, materials[material].specular_colour_texture,
                                 materials[material].transmission_texture, materials[material].clearcoat_texture,
                                 materials[material].clearcoat_roughness_texture,
                                 materials[material].occlusion_texture);
        for (int i = 0; i < 9; ++i) {
            if (numbers[i] == NONE || (!is_rough && i != 0 && i != 2))
                continue;
            vec4 texel = texel_at_hit(hit, numbers[i]);
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
            } else {
                occlusion = 1.0 + (texel.x - 1.0) * materials[material].occlusion_strength;
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
    }
}
