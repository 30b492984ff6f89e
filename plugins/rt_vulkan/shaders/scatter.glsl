// SPDX-License-Identifier: Apache-2.0
//
// Rays that go on from surfaces (rt_embree's kernel/scatter.inl). They wait on a stack, since shaders don't recurse.

// A ray, whose light arrives by `throughput` in the picture.
struct Path {
    vec3 origin, direction, throughput;
    uint depth; // bounces so far
};

Path waiting[waiting_capacity];
int waiting_count;

void send_on(Path from, vec3 origin, vec3 direction, vec3 throughput) {
    waiting[waiting_count++] = Path(origin, direction, throughput, from.depth + 1u);
}

// Below this a ray's light can't be seen.
const float faint = 1e-4;
// Rays that would change no 8-bit code by half a step end.
const float least_throughput = 2e-3;

vec3 above(Surface s) {
    return s.position + s.geometric_normal * s.offset;
}

void send_reflected(Path path, Surface s, vec3 direction, vec3 share) {
    vec3 throughput = path.throughput * share;
    if (largest(throughput) > faint)
        send_on(path, above(s), mirror_direction_off_facet(direction, s.normal, s.geometric_normal), throughput);
}

// Both branches, or the one that chance chooses. Returns the light that stands for what is not followed.
vec3 scatter_in_glass(Path path, Surface s, vec3 direction, uint material, Random random) {
    vec3 throughput = path.throughput;
    if (s.from_behind)
        throughput *= bouguer(materials[material].extinction, s.way);
    float index = materials[material].index, ratio = s.from_behind ? index : 1.0 / index;
    vec3 normal = s.normal;
    float cosine = max(-dot(direction, normal), 0.0), squared = refracted_cosine_squared(cosine, ratio);
    float refracted_cosine = sqrt(max(squared, 0.0));
    vec3 refracted = refracted_direction(direction, normal, ratio, cosine, refracted_cosine);
    // As with reflection: a refracted ray that stays outside is bent by the facet's own normal.
    if (dot(refracted, s.geometric_normal) > 0.0 && squared > 0.0) {
        normal = s.geometric_normal;
        cosine = max(-dot(direction, normal), 0.0);
        squared = refracted_cosine_squared(cosine, ratio);
        refracted_cosine = sqrt(max(squared, 0.0));
        refracted = refracted_direction(direction, normal, ratio, cosine, refracted_cosine);
    }
    float reflectance =
        glass_reflected_fraction(s.from_behind, cosine, squared, materials[material].fresnel_exponent,
                              materials[material].fresnel_minimum, materials[material].fresnel_maximum);

    vec3 refracted_share = throughput * materials[material].refraction * (1.0 - reflectance);
    vec3 reflected_share = throughput * materials[material].reflectivity * reflectance;
    bool refracts = !(squared < 0.0), reflects = true;
    if (frame.one_path != 0u) {
        bool chosen = pair(random, GLASS_PURPOSE, 0u, 1u).x < reflectance;
        refracts = refracts && !chosen;
        reflects = chosen;
        refracted_share = throughput * materials[material].refraction;
        reflected_share = throughput * materials[material].reflectivity;
    }
    vec3 cutoff_colour = materials[material].cutoff_colour, ended = vec3(0.0);
    float cutoff = materials[material].importance_cutoff;
    if (refracts) {
        if (path.depth < materials[material].refraction_depth && luminance(refracted_share) > cutoff)
            send_on(path, s.position - s.geometric_normal * s.offset, refracted, refracted_share);
        else
            ended += refracted_share * cutoff_colour;
    }
    if (reflects) {
        if (path.depth < materials[material].reflection_depth && luminance(reflected_share) > cutoff)
            send_on(path, above(s), mirror_direction_off_facet(direction, s.normal, s.geometric_normal),
                    reflected_share);
        else
            ended += reflected_share * cutoff_colour;
    }
    return ended;
}

// A ray off a microfacet.
void scatter_off_roughness(Path path, Surface s, vec3 to_eye, Random random) {
    vec2 where = pair(random, ROUGH_PURPOSE, 0u, 1u);
    vec3 half_way = ggx_half_vector(s.normal, to_eye, s.alpha, where.x, where.y);
    vec3 direction = mirror_direction(-to_eye, half_way);
    float cosine = dot(direction, s.normal);
    // The masking of the way in is in the choice of the facet.
    vec3 throughput =
        path.throughput * schlick(s.specular, dot(to_eye, half_way)) * ggx_masking(cosine, s.alpha);
    if (cosine > 0.0 && dot(direction, s.geometric_normal) > 0.0 && largest(throughput) > least_throughput)
        send_on(path, above(s), direction, throughput);
}

// Returns the light that stands for rays that are not followed.
vec3 scatter(Path path, Surface s, vec3 direction, uint material, Random random) {
    uint model = materials[material].model;
    if (path.depth >= frame.max_depth)
        return has_glass && model == GLASS ? path.throughput * materials[material].cutoff_colour : vec3(0.0);
    if (model == MIRROR)
        send_reflected(path, s, direction, materials[material].reflectivity);
    else if (model == METAL)
        send_reflected(path, s, direction, schlick(materials[material].reflectivity, -dot(direction, s.normal)));
    else if (has_glass && model == GLASS)
        return scatter_in_glass(path, s, direction, material, random);
    else if (model == METALLIC_ROUGHNESS)
        scatter_off_roughness(path, s, -direction, random);
    return vec3(0.0);
}
