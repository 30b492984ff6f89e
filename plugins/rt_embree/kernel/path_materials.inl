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

// Reflection and refraction at glass. `transmittance`: of the way inside to the surface.
struct GlassScatter {
    Float reflectance;
    Vec3 transmittance, refracted;
};
ARHOST_INLINE GlassScatter scatter_at_glass(const Surface &s, Vec3 direction, const arhost_material &glass,
                                            Bool active) {
    const Float ratio = select(s.back_face, Float(glass.index), Float(1 / glass.index));
    const Refraction refraction = refraction_of(s, direction, ratio, active);
    return {dielectric_reflectance(refraction.cosine, refraction.cosine_squared, ratio),
            select(s.back_face, bouguer(splat(glass.extinction), s.distance), white()), refraction.direction};
}
