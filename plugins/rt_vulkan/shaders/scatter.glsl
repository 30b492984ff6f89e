// SPDX-License-Identifier: Apache-2.0
//
// Secondary rays. They wait on a stack, because shaders cannot recurse. Equivalent to rt_embree's kernel/scatter.inl.

// The results of a sample. The integrator `whitted` uses only the first.
const uint OBJECT_PLANE = 0u, // radiance of virtual objects
    CHANGE_PLANE = 1u,        // change of a catcher's diffuse light
    MIRRORED_PLANE = 2u,      // light of virtual objects that a glossy catcher mirrors
    COVERED_PLANE = 3u;       // light that it mirrors only without them
// This bit of Path::plane marks rays towards virtual objects from filmed surfaces that secondary rays hit.
const uint FILMED_BIT = 4u;

// A ray, and the throughput of the path from the pixel to this ray.
struct Path {
    vec3 origin, direction, throughput;
    // Reciprocal of the density per steradian of the last random direction, times `sample_ratio` of push_bounce(). It is 0 if there is no such direction, and
    // negative if mirrors or glass have reflected or refracted the path since.
    float inverse_density;
    uint depth; // number of bounces so far
    uint plane; // to which the radiance is added
    bool is_random; // whether random choices other than that of a direction have scattered the path
};

Path stack[stack_capacity];
int stack_size;

void push(Path from, vec3 origin, vec3 direction, vec3 throughput, float inverse_density) {
    stack[stack_size++] =
        Path(origin, direction, throughput, inverse_density, from.depth + 1u, from.plane, from.is_random);
}

// Reflected rays below this throughput are invisible.
const float min_throughput = 1e-4;

// Returns the origin of rays that leave a surface on the side that faces the viewer.
vec3 above(Surface s) {
    return s.position + s.geometric_normal * s.offset;
}
vec3 below(Surface s) {
    return s.position - s.geometric_normal * s.offset;
}

vec3 reflected(Surface s, vec3 direction) {
    return mirror_direction_off_facet(direction, s.normal, s.geometric_normal);
}

void push_reflected(Path path, Surface s, vec3 direction, vec3 reflectance) {
    vec3 throughput = path.throughput * reflectance;
    if (largest(throughput) > min_throughput)
        push(path, above(s), reflected(s, direction), throughput, -abs(path.inverse_density));
}

// The refraction of a ray at a surface. `cosine`: cosine of the angle of incidence.
struct Refraction {
    float cosine, cosine_squared; // cosine_squared: of the angle of refraction; negative for total internal reflection
    vec3 direction;
};
Refraction refraction_at(vec3 direction, vec3 normal, float ratio) {
    float cosine = max(-dot(direction, normal), 0.0), squared = refracted_cosine_squared(cosine, ratio);
    return Refraction(cosine, squared,
                      refracted_direction(direction, normal, ratio, cosine, sqrt(max(squared, 0.0))));
}

// If refraction at the interpolated normal leaves the ray on the wrong side of the surface, the geometric normal is used
// instead; reflected() does the same for reflection.
Refraction refraction_of(Surface s, vec3 direction, float ratio) {
    Refraction refraction = refraction_at(direction, s.normal, ratio);
    if (dot(refraction.direction, s.geometric_normal) > 0.0 && refraction.cosine_squared > 0.0)
        refraction = refraction_at(direction, s.geometric_normal, ratio);
    return refraction;
}

// Pushes the reflected and the refracted ray, or, with frame.single_path, only one of them, chosen at random. A ray is
// not traced if it exceeds the depth limit or falls below the importance cutoff. The function then returns the cutoff
// colour, which the ray contributes instead.
vec3 scatter_in_glass(Path path, Surface s, vec3 direction, uint material, Random random) {
    vec3 throughput = path.throughput;
    if (s.back_face)
        throughput *= bouguer(materials[material].extinction, s.distance);
    float index = materials[material].index, ratio = s.back_face ? index : 1.0 / index;
    Refraction refraction = refraction_of(s, direction, ratio);
    float reflectance = glass_reflected_fraction(
        s.back_face, refraction.cosine, refraction.cosine_squared, materials[material].fresnel_exponent,
        materials[material].fresnel_minimum, materials[material].fresnel_maximum);

    vec3 refracted_share = throughput * materials[material].refraction * (1.0 - reflectance);
    vec3 reflected_share = throughput * materials[material].reflectivity * reflectance;
    bool refracts = !(refraction.cosine_squared < 0.0), reflects = true;
    if (frame.single_path != 0u) {
        bool chooses_reflection = pair(random, GLASS_PURPOSE, 0u, 1u).x < reflectance;
        refracts = refracts && !chooses_reflection;
        reflects = chooses_reflection;
        refracted_share = throughput * materials[material].refraction;
        reflected_share = throughput * materials[material].reflectivity;
    }
    vec3 cutoff_colour = materials[material].cutoff_colour, cut_off = vec3(0.0);
    float cutoff = materials[material].importance_cutoff;
    if (refracts) {
        if (path.depth < materials[material].refraction_depth && luminance(refracted_share) > cutoff)
            push(path, below(s), refraction.direction, refracted_share, -abs(path.inverse_density));
        else
            cut_off += refracted_share * cutoff_colour;
    }
    if (reflects) {
        if (path.depth < materials[material].reflection_depth && luminance(reflected_share) > cutoff)
            push(path, above(s), reflected(s, direction), reflected_share, -abs(path.inverse_density));
        else
            cut_off += reflected_share * cutoff_colour;
    }
    return cut_off;
}

// Pushes a ray that is reflected off a randomly sampled microfacet.
void scatter_rough(Path path, Surface s, vec3 to_eye, vec2 sample_uv) {
    vec3 half_vector = ggx_half_vector(s.normal, to_eye, s.alpha, sample_uv.x, sample_uv.y);
    vec3 direction = mirror_direction(-to_eye, half_vector);
    float cosine = dot(direction, s.normal);
    // Sampling visible normals already accounts for the masking of `to_eye`.
    vec3 throughput =
        path.throughput * fresnel_of(s, dot(to_eye, half_vector)) * ggx_masking(cosine, s.alpha);
    float density = ggx_reflection_density(dot(s.normal, to_eye), dot(s.normal, half_vector), s.alpha);
    if (cosine > 0.0 && dot(direction, s.geometric_normal) > 0.0 && largest(throughput) > min_throughput)
        push(path, above(s), direction, throughput, 1.0 / max(density, 1e-30));
}

// Pushes the secondary rays of a surface. For rays that are cut off, returns the light that replaces them.
vec3 scatter(Path path, Surface s, vec3 direction, uint material, Random random) {
    uint model = materials[material].model;
    if (path.depth >= frame.max_depth)
        return has_glass && model == GLASS ? path.throughput * materials[material].cutoff_colour : vec3(0.0);
    if (model == MIRROR)
        push_reflected(path, s, direction, materials[material].reflectivity);
    else if (model == METAL)
        push_reflected(path, s, direction, schlick(materials[material].reflectivity, -dot(direction, s.normal)));
    else if (has_glass && model == GLASS)
        return scatter_in_glass(path, s, direction, material, random);
    else if (model == METALLIC_ROUGHNESS)
        scatter_rough(path, s, -direction, pair(random, ROUGH_PURPOSE, 0u, 1u));
    return vec3(0.0);
}
