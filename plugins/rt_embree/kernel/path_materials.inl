// SPDX-License-Identifier: Apache-2.0
//
// How surfaces scatter light in the path integrator.
#pragma once
#include "scatter.inl"

// The chances that a lit surface scatters a ray by its clear coat, and, if not, by its specular lobe.
struct LobeChances {
    Float coat, specular;
};

// The chance that a lit surface scatters a ray that its clear coat does not scatter by its specular lobe.
ARHOST_INLINE Float specular_chance(const Surface &s, Vec3 to_eye) {
    if (!s.any_rough)
        return Float(0.0f);
    const Float specular = luminance(fresnel_of(s, dot(s.normal, to_eye)));
    const Float diffuse = luminance(s.any_sheen ? s.diffuse + s.sheen : s.diffuse);
    const Float chance = specular / max(specular + diffuse, Float(1e-6f));
    const Float bounded = min(max(chance, Float(0.1f)), Float(0.9f));
    return select(s.is_rough, select(diffuse > Float(0.0f), bounded, Float(1.0f)), Float(0.0f));
}

ARHOST_INLINE LobeChances lobe_chances(const Surface &s, Vec3 to_eye) {
    const Float specular = specular_chance(s, to_eye);
    if (!s.any_coat)
        return {Float(0.0f), specular};
    const Float coat = Float(1.0f) - below_coat(s, to_eye);
    const Float below =
        (luminance(fresnel_of(s, dot(s.normal, to_eye))) + luminance(s.diffuse)) * (Float(1.0f) - coat);
    const Float chance = min(max(coat / max(coat + below, Float(1e-6f)), Float(0.1f)), Float(0.9f));
    return {select(s.coat > Float(0.0f), chance, Float(0.0f)), specular};
}

// Returns the highlights of SPECULAR and METAL. Only light samples bring them; scattered rays do not follow this
// lobe.
ARHOST_INLINE Vec3 highlight(const Surface &s, Vec3 to_eye, Vec3 to_light) {
    if (!s.any_specular)
        return black();
    return select(s.is_rough, black(), s.specular * phong(s.normal, to_light, to_eye, s.exponent));
}

// Returns the share of the light to the eye that passes the fibres.
ARHOST_INLINE Float below_sheen(const Surface &s, Vec3 to_eye) {
    return Float(1.0f) - largest(s.sheen) * sheen_albedo(dot(s.normal, to_eye), s.sheen_roughness);
}

// Returns π · BSDF · cosine of a lit surface, without highlight().
ARHOST_INLINE Vec3 scattering(const Surface &s, Vec3 to_eye, Vec3 to_light) {
    const Float cosine = lambert(s.normal, to_light);
    Vec3 scattered = s.diffuse * cosine;
    if (s.any_rough) {
        const Vec3 half_vector = normalize(to_light + to_eye);
        const Vec3 fresnel = fresnel_of(s, dot(to_eye, half_vector));
        const Float lobe = rough_lobe(s, to_eye, to_light, half_vector);
        scattered =
            select(s.is_rough, s.diffuse * passing_fresnel(s, dot(to_eye, half_vector)) * cosine + fresnel * lobe,
                   scattered);
        if (s.any_sheen)
            scattered = scattered * below_sheen(s, to_eye) +
                        s.sheen * sheen_lobe(cosine, dot(s.normal, to_eye), dot(s.normal, half_vector),
                                             s.sheen_roughness * s.sheen_roughness);
        if (s.any_coat) {
            const Float coat = s.coat * coat_reflectance(dot(to_eye, half_vector)) *
                               ggx_lobe(lambert(s.coat_normal, to_light), dot(s.coat_normal, to_eye),
                                        dot(s.coat_normal, half_vector), s.coat_alpha);
            scattered = scattered * below_coat(s, to_eye) + Vec3{coat, coat, coat};
        }
    }
    return scattered;
}

// Returns the part of scattering() that the specular lobe of a rough surface reflects.
ARHOST_INLINE Vec3 gloss(const Surface &s, Vec3 to_eye, Vec3 to_light) {
    const Vec3 half_vector = normalize(to_light + to_eye);
    const Float lobe = rough_lobe(s, to_eye, to_light, half_vector);
    return select(s.is_rough, fresnel_of(s, dot(to_eye, half_vector)) * lobe, black());
}

// Density per steradian of the rays that a lit surface without a clear coat scatters. `chance`: of the specular lobe.
ARHOST_INLINE Float scattering_density(const Surface &s, Vec3 to_eye, Vec3 to_light, Float chance) {
    Float density = lambert(s.normal, to_light) * Float(0.318309886f) * (Float(1.0f) - chance);
    if (s.any_rough)
        density = density + select(s.is_rough, chance * reflection_density(s, to_eye, normalize(to_light + to_eye)),
                                   Float(0.0f));
    return select(dot(to_light, s.geometric_normal) > Float(0.0f), density, Float(0.0f));
}

ARHOST_INLINE Float scattering_density(const Surface &s, Vec3 to_eye, Vec3 to_light, const LobeChances &chances) {
    const Float density = scattering_density(s, to_eye, to_light, chances.specular);
    if (!s.any_coat)
        return density;
    const Float by_coat = ggx_reflection_density(dot(s.coat_normal, to_eye),
                                                 dot(s.coat_normal, normalize(to_light + to_eye)), s.coat_alpha);
    return density +
           select(dot(to_light, s.geometric_normal) > Float(0.0f), (by_coat - density) * chances.coat, Float(0.0f));
}

// The chance that METAL, a mirror over a diffuse surface, reflects a ray like a mirror.
ARHOST_INLINE Float metal_mirror_chance(Vec3 reflectance, Vec3 diffuse) {
    const Float mirror = luminance(reflectance);
    return mirror / max(mirror + luminance(diffuse), Float(1e-6f));
}

// Reflection and refraction at glass. `transmittance`: of the way inside to the surface. The `unmasked` shares of the
// reflected and of the refracted light pass by other microfacets.
struct GlassScatter {
    Float reflectance;
    Vec3 transmittance, reflected, refracted;
    Float unmasked_reflected, unmasked_refracted;
};

// Returns the share of the light in `direction` that no other microfacet masks; 0 if the direction does not leave to
// the side of the normals.
ARHOST_INLINE Float unmasked(Vec3 direction, Vec3 normal, Vec3 geometric_normal, Float alpha) {
    const Float cosine = dot(direction, normal);
    const Bool leaves = (cosine > Float(0.0f)) & (dot(direction, geometric_normal) > Float(0.0f));
    return select(leaves, ggx_masking(cosine, alpha), Float(0.0f));
}

// The glass of a GLASS material, or of the part of a metallic-roughness material that transmits light.
struct Glass {
    float index;
    bool is_rough, is_thin;
    Float alpha; // GGX roughness parameter, if it is rough
    Vec3 reflection, refraction, extinction;
};
ARHOST_INLINE Glass glass_of(const arhost_material &material, const Surface &s) {
    const bool is_part = material.model != ARHOST_MATERIAL_GLASS;
    return {material.index,
            material.roughness > 0,
            is_part && material.thin_walled != 0,
            is_part ? s.alpha : ggx_alpha(Float(material.roughness)),
            is_part ? white() : splat(material.reflectivity),
            is_part ? s.transmitted : splat(material.refraction),
            splat(material.extinction)};
}

// `uv`: random numbers that choose the microfacet of rough glass (Walter et al., Microfacet Models for Refraction,
// EGSR 2007).
ARHOST_INLINE GlassScatter scatter_at_glass(const Surface &s, Vec3 direction, const Glass &glass, Pair uv,
                                            Bool active) {
    const Bool from_inside = s.back_face & bool_of(!glass.is_thin);
    const Float ratio = select(from_inside, Float(glass.index), Float(1 / glass.index));
    GlassScatter scatter;
    scatter.transmittance = select(from_inside, bouguer(glass.extinction, s.distance), white());
    Refraction refraction;
    if (glass.is_rough) {
        const Float alpha = glass.alpha;
        const Vec3 facet = ggx_half_vector(s.normal, -direction, alpha, uv.u, uv.v);
        refraction = refraction_at(direction, facet, ratio);
        scatter.reflected = mirror_direction(direction, facet);
        if (glass.is_thin)
            refraction.direction = mirror_direction(scatter.reflected, s.normal);
        // Sampling visible normals already accounts for the masking of `direction`.
        scatter.unmasked_reflected = unmasked(scatter.reflected, s.normal, s.geometric_normal, alpha);
        scatter.unmasked_refracted = unmasked(refraction.direction, -s.normal, -s.geometric_normal, alpha);
    } else {
        refraction = refraction_of(s, direction, ratio, active);
        scatter.reflected = reflected(s, direction);
        if (glass.is_thin)
            refraction.direction = direction;
        scatter.unmasked_reflected = scatter.unmasked_refracted = Float(1.0f);
    }
    scatter.refracted = refraction.direction;
    scatter.reflectance = dielectric_reflectance(refraction.cosine, refraction.cosine_squared, ratio);
    return scatter;
}
