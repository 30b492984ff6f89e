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
};

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

vec3 texture_colour(Hit hit, uint number) {
    if (objects[hit.object].first_texcoord == NONE)
        return vec3(1.0);
    return sample_texture(number, texcoord_at(hit.object, primitives[hit.primitive].number, hit.uv)).rgb;
}

// Returns `normal`, perturbed by the normal texture. `facet` is the geometric normal. The tangents are constant over
// each triangle.
vec3 normal_mapped(Hit hit, vec3 facet, vec3 normal) {
    uint first = objects[hit.object].first_index + 3u * primitives[hit.primitive].number;
    vec2 texcoords[3];
    for (int i = 0; i < 3; ++i) {
        uint from = objects[hit.object].first_texcoord + 2u * indices[first + uint(i)];
        texcoords[i] = vec2(attributes[from], attributes[from + 1u]);
    }
    vec3 edge_1 = -primitives[hit.primitive].edge_1, edge_2 = primitives[hit.primitive].edge_2;
    vec2 delta_1 = texcoords[1] - texcoords[0], delta_2 = texcoords[2] - texcoords[0];
    vec3 along_u = tangent_along_u(edge_1, edge_2, delta_1.x, delta_2.x, delta_1.y, delta_2.y);
    vec3 along_v = tangent_along_v(edge_1, edge_2, delta_1.x, delta_2.x, delta_1.y, delta_2.y);
    if ((objects[hit.object].flags & HAS_TRANSFORM) != 0u) {
        along_u = objects[hit.object].transform * along_u;
        along_v = objects[hit.object].transform * along_v;
    }
    return perturbed_normal(normal, facet, along_u, along_v,
                       texture_colour(hit, materials[objects[hit.object].material].normal_texture));
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
    vec3 vertex_normal = normal;
    if (has_textures && normal_maps && materials[material].model == METALLIC_ROUGHNESS &&
        materials[material].normal_texture != NONE && objects[object].first_texcoord != NONE)
        normal = normal_mapped(hit, geometric, normal);

    Surface s;
    s.position = ray.origin + path;
    s.distance = length(path);
    s.is_real = objects[object].role != VIRTUAL;
    s.geometric_normal = normalize_or(geometric, -normalize(ray.direction));
    s.offset = offset_from_surface(s.position, path, s.geometric_normal, objects[object].extent);
    s.back_face = dot(s.geometric_normal, ray.direction) > 0.0;
    s.geometric_normal = facing(s.geometric_normal, -ray.direction);
    s.normal = shading_normal(normal, s.geometric_normal);
    s.lift = vec3(0.0);
    if (objects[object].first_normal != NONE && materials[material].model != MIRROR &&
        materials[material].model != GLASS) {
        bool from_behind = dot(vertex_normal, geometric) * dot(geometric, ray.direction) > 0.0;
        s.lift = lift_of(hit, from_behind ? -1.0 : 1.0);
        if ((objects[object].flags & HAS_TRANSFORM) != 0u)
            s.lift = objects[object].transform * s.lift;
    }
    s.ambient = s.diffuse = s.specular = s.emission = vec3(0.0);
    s.exponent = s.alpha = 0.0;
    s.is_rough = false;
    return s;
}

// Sets the material properties of a surface that is neither a mirror nor glass.
void add_material(inout Surface s, Hit hit) {
    uint material = objects[hit.object].material, model = materials[material].model;
    bool is_rough = model == METALLIC_ROUGHNESS;
    s.ambient = materials[material].ambient;
    s.diffuse = materials[material].diffuse;
    s.emission = materials[material].emission;
    float metallic = materials[material].metallic, roughness = materials[material].roughness;
    if (has_textures) {
        // A loop rather than three calls, because texture sampling is inlined and its code is long.
        uvec3 numbers = uvec3(materials[material].colour_texture, materials[material].metallic_roughness_texture,
                              materials[material].emission_texture);
        if (!is_rough)
            numbers.y = NONE;
        if (!(s.emission.x + s.emission.y + s.emission.z > 0.0))
            numbers.z = NONE;
        for (int i = 0; i < 3; ++i) {
            if (numbers[i] == NONE)
                continue;
            vec3 factors = texture_colour(hit, numbers[i]);
            if (i == 0) {
                s.ambient *= factors;
                s.diffuse *= factors;
            } else if (i == 1) {
                metallic *= factors.z;
                roughness *= factors.y;
            } else {
                s.emission *= factors;
            }
        }
    }
    if (model == SPECULAR || model == METAL) {
        s.specular = materials[material].specular;
        s.exponent = materials[material].exponent;
    }
    if (is_rough) {
        s.specular = metallic_reflectance(s.diffuse, metallic);
        s.alpha = ggx_alpha(roughness);
        s.is_rough = true;
        s.ambient = metallic_diffuse(s.ambient, metallic);
        s.diffuse = metallic_diffuse(s.diffuse, metallic);
    }
}
