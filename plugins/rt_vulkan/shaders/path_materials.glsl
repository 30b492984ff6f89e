// SPDX-License-Identifier: Apache-2.0
//
// How surfaces scatter light in the path integrator. Equivalent to rt_embree's kernel/path_materials.inl.

// The chance that a lit surface scatters a ray by its specular lobe.
float specular_chance(Surface s, vec3 to_eye) {
    if (!s.is_rough)
        return 0.0;
    float specular = luminance(fresnel_of(s, dot(s.normal, to_eye)));
    float diffuse = luminance(has_sheen ? s.diffuse + s.sheen : s.diffuse);
    return diffuse > 0.0 ? clamp(specular / max(specular + diffuse, 1e-6), 0.1, 0.9) : 1.0;
}

// The chance that a lit surface scatters a ray by its clear coat.
float coat_chance(Surface s, vec3 to_eye) {
    if (!has_coat || !(s.coat > 0.0))
        return 0.0;
    float coat = 1.0 - below_coat(s, to_eye);
    float below = (luminance(fresnel_of(s, dot(s.normal, to_eye))) + luminance(s.diffuse)) * (1.0 - coat);
    return clamp(coat / max(coat + below, 1e-6), 0.1, 0.9);
}

// Returns the highlights of SPECULAR and METAL. Only light samples bring them; scattered rays do not follow this lobe.
vec3 highlight(Surface s, vec3 to_eye, vec3 to_light) {
    return !s.is_rough && s.exponent > 0.0 ? s.specular * phong(s.normal, to_light, to_eye, s.exponent) : vec3(0.0);
}

// Returns π · BSDF · cosine of a lit surface, without highlight().
vec3 scattering(Surface s, vec3 to_eye, vec3 to_light) {
    float cosine = lambert(s.normal, to_light);
    if (s.is_rough) {
        vec3 half_vector = normalize(to_light + to_eye), fresnel = fresnel_of(s, dot(to_eye, half_vector));
        float lobe = rough_lobe(s, to_eye, to_light, half_vector);
        vec3 scattered = s.diffuse * passing_fresnel(s, dot(to_eye, half_vector)) * cosine + fresnel * lobe;
        if (has_sheen && largest(s.sheen) > 0.0)
            scattered = scattered * below_sheen(s, to_eye) +
                        s.sheen * sheen_lobe(cosine, dot(s.normal, to_eye), dot(s.normal, half_vector),
                                             s.sheen_roughness * s.sheen_roughness);
        if (has_coat && s.coat > 0.0)
            scattered = scattered * below_coat(s, to_eye) +
                        vec3(s.coat * coat_reflectance(dot(to_eye, half_vector)) *
                             ggx_lobe(lambert(s.coat_normal, to_light), dot(s.coat_normal, to_eye),
                                      dot(s.coat_normal, half_vector), s.coat_alpha));
        return scattered;
    }
    return s.diffuse * cosine;
}

// Returns the part of scattering() that the specular lobe of a rough surface reflects.
vec3 gloss(Surface s, vec3 to_eye, vec3 to_light) {
    vec3 half_vector = normalize(to_light + to_eye);
    return fresnel_of(s, dot(to_eye, half_vector)) * rough_lobe(s, to_eye, to_light, half_vector);
}

// Density per steradian of the rays that a lit surface scatters. `chance`: result of specular_chance(); `by_coat`: of
// coat_chance().
float scattering_density(Surface s, vec3 to_eye, vec3 to_light, float chance, float by_coat) {
    if (!(dot(to_light, s.geometric_normal) > 0.0))
        return 0.0;
    float density = lambert(s.normal, to_light) * 0.318309886 * (1.0 - chance);
    if (s.is_rough)
        density += chance * reflection_density(s, to_eye, normalize(to_light + to_eye));
    if (has_coat && by_coat > 0.0)
        density += by_coat * (ggx_reflection_density(dot(s.coat_normal, to_eye),
                                                     dot(s.coat_normal, normalize(to_light + to_eye)), s.coat_alpha) -
                              density);
    return density;
}

// The chance that a surface reflects a ray like a mirror; METAL is a mirror over a diffuse surface. `reflectance`: of
// the mirror.
float mirror_chance_of(Surface s, vec3 direction, uint material, out vec3 reflectance) {
    reflectance = materials[material].reflectivity;
    if (materials[material].model != METAL)
        return materials[material].model == MIRROR ? 1.0 : 0.0;
    reflectance = schlick(reflectance, -dot(direction, s.normal));
    float mirror = luminance(reflectance);
    return mirror / max(mirror + luminance(s.diffuse), 1e-6);
}

// Reflection and refraction at glass. `transmittance`: of the way inside to the surface. The `unmasked` shares of the
// reflected and of the refracted light pass by other microfacets.
struct GlassScatter {
    float reflectance;
    vec3 transmittance, reflected, refracted, reflection_tint, refraction_tint;
    float unmasked_reflected, unmasked_refracted;
};

// Returns the share of the light in `direction` that no other microfacet masks; 0 if the direction does not leave to the
// side of the normals.
float unmasked(vec3 direction, vec3 normal, vec3 geometric_normal, float alpha) {
    float cosine = dot(direction, normal);
    return cosine > 0.0 && dot(direction, geometric_normal) > 0.0 ? ggx_masking(cosine, alpha) : 0.0;
}

// `uv`: random numbers that choose the microfacet of rough glass (Walter et al., Microfacet Models for Refraction,
// EGSR 2007).
// `is_rough`: whether the surface is treated as rough. The result has the tints of the material.
GlassScatter scatter_at_glass(Surface s, vec3 direction, uint material, vec2 uv, bool is_rough) {
    bool is_part = materials[material].model != GLASS, is_thin = is_part && materials[material].thin_walled != 0u;
    bool from_inside = s.back_face && !is_thin;
    float index = materials[material].index, ratio = from_inside ? index : 1.0 / index;
    GlassScatter glass;
    glass.transmittance = from_inside ? bouguer(materials[material].extinction, s.distance) : vec3(1.0);
    glass.reflection_tint = is_part ? vec3(1.0) : materials[material].reflectivity;
    glass.refraction_tint = is_part ? s.transmitted : materials[material].refraction;
    Refraction refraction;
    if (is_rough) {
        float alpha = is_part ? s.alpha : ggx_alpha(materials[material].roughness);
        vec3 facet = ggx_half_vector(s.normal, -direction, alpha, uv.x, uv.y);
        refraction = refraction_at(direction, facet, ratio);
        glass.reflected = mirror_direction(direction, facet);
        if (is_thin)
            refraction.direction = mirror_direction(glass.reflected, s.normal);
        // Sampling visible normals already accounts for the masking of `direction`.
        glass.unmasked_reflected = unmasked(glass.reflected, s.normal, s.geometric_normal, alpha);
        glass.unmasked_refracted = unmasked(refraction.direction, -s.normal, -s.geometric_normal, alpha);
    } else {
        refraction = refraction_of(s, direction, ratio);
        glass.reflected = reflected(s, direction);
        if (is_thin)
            refraction.direction = direction;
        glass.unmasked_reflected = glass.unmasked_refracted = 1.0;
    }
    glass.refracted = refraction.direction;
    glass.reflectance = dielectric_reflectance(refraction.cosine, refraction.cosine_squared, ratio);
    return glass;
}
