// SPDX-License-Identifier: Apache-2.0
//
// How surfaces scatter light in the path integrator.
#pragma once
#include "scatter.inl"

// The chance that a lit surface scatters a ray by its specular lobe.
ARHOST_INLINE Float specular_chance(const Surface &s, Vec3 to_eye) {
    if (!s.any_rough)
        return Float(0.0f);
    const Float specular = luminance(schlick(s.specular, dot(s.normal, to_eye))), diffuse = luminance(s.diffuse);
    const Float chance = specular / max(specular + diffuse, Float(1e-6f));
    const Float bounded = min(max(chance, Float(0.1f)), Float(0.9f));
    return select(s.is_rough, select(diffuse > Float(0.0f), bounded, Float(1.0f)), Float(0.0f));
}

// Returns the highlights of SPECULAR and METAL. Only light samples bring them; scattered rays do not follow this
// lobe.
ARHOST_INLINE Vec3 highlight(const Surface &s, Vec3 to_eye, Vec3 to_light) {
    if (!s.any_specular)
        return black();
    return select(s.is_rough, black(), s.specular * phong(s.normal, to_light, to_eye, s.exponent));
}

// Returns π · BSDF · cosine of a lit surface, without highlight().
ARHOST_INLINE Vec3 scattering(const Surface &s, Vec3 to_eye, Vec3 to_light) {
    const Float cosine = lambert(s.normal, to_light);
    Vec3 scattered = s.diffuse * cosine;
    if (s.any_rough) {
        const Vec3 half_vector = normalize(to_light + to_eye);
        const Vec3 fresnel = schlick(s.specular, dot(to_eye, half_vector));
        const Float lobe = ggx_lobe(cosine, dot(s.normal, to_eye), dot(s.normal, half_vector), s.alpha);
        scattered = select(s.is_rough, s.diffuse * (white() - fresnel) * cosine + fresnel * lobe, scattered);
    }
    return scattered;
}

// Returns the part of scattering() that the specular lobe of a rough surface reflects.
ARHOST_INLINE Vec3 gloss(const Surface &s, Vec3 to_eye, Vec3 to_light) {
    const Vec3 half_vector = normalize(to_light + to_eye);
    const Float lobe =
        ggx_lobe(lambert(s.normal, to_light), dot(s.normal, to_eye), dot(s.normal, half_vector), s.alpha);
    return select(s.is_rough, schlick(s.specular, dot(to_eye, half_vector)) * lobe, black());
}

// Density per steradian of the rays that a lit surface scatters.
ARHOST_INLINE Float scattering_density(const Surface &s, Vec3 to_eye, Vec3 to_light, Float chance) {
    Float density = lambert(s.normal, to_light) * Float(0.318309886f) * (Float(1.0f) - chance);
    if (s.any_rough)
        density =
            density + select(s.is_rough,
                             chance * ggx_reflection_density(dot(s.normal, to_eye),
                                                             dot(s.normal, normalize(to_light + to_eye)), s.alpha),
                             Float(0.0f));
    return select(dot(to_light, s.geometric_normal) > Float(0.0f), density, Float(0.0f));
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

// `uv`: random numbers that choose the microfacet of rough glass (Walter et al., Microfacet Models for Refraction,
// EGSR 2007).
ARHOST_INLINE GlassScatter scatter_at_glass(const Surface &s, Vec3 direction, const arhost_material &glass, Pair uv,
                                            Bool active) {
    const Float ratio = select(s.back_face, Float(glass.index), Float(1 / glass.index));
    GlassScatter scatter;
    scatter.transmittance = select(s.back_face, bouguer(splat(glass.extinction), s.distance), white());
    Refraction refraction;
    if (glass.roughness > 0) {
        const Float alpha = ggx_alpha(Float(glass.roughness));
        const Vec3 facet = ggx_half_vector(s.normal, -direction, alpha, uv.u, uv.v);
        refraction = refraction_at(direction, facet, ratio);
        scatter.reflected = mirror_direction(direction, facet);
        // Sampling visible normals already accounts for the masking of `direction`.
        scatter.unmasked_reflected = unmasked(scatter.reflected, s.normal, s.geometric_normal, alpha);
        scatter.unmasked_refracted = unmasked(refraction.direction, -s.normal, -s.geometric_normal, alpha);
    } else {
        refraction = refraction_of(s, direction, ratio, active);
        scatter.reflected = reflected(s, direction);
        scatter.unmasked_reflected = scatter.unmasked_refracted = Float(1.0f);
    }
    scatter.refracted = refraction.direction;
    scatter.reflectance = dielectric_reflectance(refraction.cosine, refraction.cosine_squared, ratio);
    return scatter;
}
