// SPDX-License-Identifier: Apache-2.0
// How surfaces scatter light. A leaf file: see ../scalar.hpp.
// All directions have length 1 and point away from the surface, but for the incident one of a mirror.

// Lambert: the share of a light's irradiance that an inclined surface receives (Lambert 1760).
ARHOST_LEAF Float lambert(Vec3 normal, Vec3 to_light) {
    return max(dot(normal, to_light), Float(0.0));
}

// The same where the normal is interpolated: nothing from behind the facet.
ARHOST_LEAF Float lambert_on_facet(Vec3 normal, Vec3 facet, Vec3 to_light) {
    return select(dot(facet, to_light) > Float(0.0), lambert(normal, to_light), Float(0.0));
}

// Phong: (r·v)^n, r being the light's direction reflected about the normal; 0 behind the surface
// (Phong, Illumination for Computer Generated Pictures, CACM 18(6), 1975).
ARHOST_LEAF Float phong(Vec3 normal, Vec3 to_light, Vec3 to_eye, Float exponent) {
    Float cosine = dot(normal, to_light);
    Vec3 reflected = normal * (Float(2.0) * cosine) - to_light;
    // The floor keeps pow away from 0; its value there is below any colour step.
    Float lobe = pow(max(dot(reflected, to_eye), Float(1e-6)), exponent);
    return select(cosine > Float(0.0), lobe, Float(0.0));
}

// The law of reflection: i − 2 (n·i) n, `incident` pointing at the surface.
ARHOST_LEAF Vec3 mirror_direction(Vec3 incident, Vec3 normal) {
    return incident - normal * (Float(2.0) * dot(normal, incident));
}

// The same where the normal is interpolated, which may send the ray into the facet: then the facet's own reflects.
ARHOST_LEAF Vec3 mirror_direction_off_facet(Vec3 incident, Vec3 normal, Vec3 facet) {
    Vec3 by_normal = mirror_direction(incident, normal);
    return select(dot(by_normal, facet) > Float(0.0), by_normal, mirror_direction(incident, facet));
}

// Schlick: the reflectance of a metal, from that at a right angle to 1 at the rim
// (Schlick, An Inexpensive BRDF Model for Physically-based Rendering, CGF 13(3), 1994, eq. 15).
ARHOST_LEAF Vec3 schlick(Vec3 at_right_angle, Float cosine) {
    Float c = Float(1.0) - min(max(cosine, Float(0.0)), Float(1.0));
    Float c2 = c * c;
    Float rim = c2 * c2 * c;
    return at_right_angle * (Float(1.0) - rim) + vec3(rim, rim, rim);
}

// Glass: Schlick's term with an exponent and limits of its own (the dissertation's table 2).
ARHOST_LEAF Float glass_reflectance(Float cosine, Float exponent, Float minimum, Float maximum) {
    // The floor keeps pow away from 0.
    Float c = max(Float(1.0) - min(max(cosine, Float(0.0)), Float(1.0)), Float(1e-6));
    return min(max(minimum + (Float(1.0) - minimum) * pow(c, exponent), minimum), maximum);
}

// Snell: the squared cosine of the refracted ray; below 0 at total reflection. `ratio` is the index of
// refraction where the ray comes from by that where it goes to.
ARHOST_LEAF Float refracted_cosine_squared(Float cosine, Float ratio) {
    return Float(1.0) - ratio * ratio * (Float(1.0) - cosine * cosine);
}

// The refracted ray's direction; both cosines are positive, `normal` faces the incident ray's origin.
ARHOST_LEAF Vec3 refracted_direction(Vec3 incident, Vec3 normal, Float ratio, Float cosine, Float refracted_cosine) {
    return incident * ratio + normal * (ratio * cosine - refracted_cosine);
}

// The share of light that a surface of glass reflects: all of it at total reflection, else by the cosine on the
// outside. `refracted_squared` is the refracted ray's squared cosine.
ARHOST_LEAF Float glass_reflected_share(Bool from_inside, Float cosine, Float refracted_squared, Float exponent,
                                        Float minimum, Float maximum) {
    Float refracted = sqrt(max(refracted_squared, Float(0.0)));
    return select(refracted_squared < Float(0.0), Float(1.0),
                  glass_reflectance(select(from_inside, refracted, cosine), exponent, minimum, maximum));
}

// Bouguer's law: what is left of light after a way of `way` mm inside, exp(−extinction · way)
// (Bouguer, Essai d'optique sur la gradation de la lumière, 1729; Lambert 1760, Beer 1852).
ARHOST_LEAF Vec3 bouguer(Vec3 extinction, Float way) {
    Vec3 power = extinction * (way * Float(-1.44269504088896)); // of 2
    return vec3(exp2(power.x), exp2(power.y), exp2(power.z));
}

// Metallic-roughness, as glTF 2.0's appendix B.3 has it: dielectrics reflect 4 % at a right angle, metals their
// colour, which is the base colour …
ARHOST_LEAF Vec3 metallic_reflectance(Vec3 base_colour, Float metallic) {
    Float dielectric = Float(0.04) * (Float(1.0) - metallic);
    return vec3(dielectric, dielectric, dielectric) + base_colour * metallic;
}
// … and only dielectrics scatter what enters them …
ARHOST_LEAF Vec3 metallic_diffuse(Vec3 base_colour, Float metallic) {
    return base_colour * (Float(1.0) - metallic);
}
// … GGX's alpha being the roughness squared. The floor keeps the distribution finite.
ARHOST_LEAF Float ggx_alpha(Float roughness) {
    return max(roughness * roughness, Float(0.001));
}

// GGX, as glTF 2.0's appendix B has it: the distribution of the
// microfacets' normals (Walter et al., Microfacet Models for Refraction, EGSR 2007, eq. 33) …
ARHOST_LEAF Float ggx_distribution(Float cosine_half, Float alpha) {
    Float a2 = alpha * alpha;
    Float d = cosine_half * cosine_half * (a2 - Float(1.0)) + Float(1.0);
    return a2 / (Float(3.14159265358979) * d * d);
}

// … and the masking and shadowing of them, Smith's, correlated by height, by 4 (n·l) (n·v)
// (Heitz, Understanding the Masking-Shadowing Function, JCGT 3(2), 2014, eq. 99).
ARHOST_LEAF Float ggx_visibility(Float cosine_light, Float cosine_eye, Float alpha) {
    Float a2 = alpha * alpha;
    Float light = cosine_eye * sqrt(cosine_light * cosine_light * (Float(1.0) - a2) + a2);
    Float eye = cosine_light * sqrt(cosine_eye * cosine_eye * (Float(1.0) - a2) + a2);
    return Float(0.5) / max(light + eye, Float(1e-7));
}

// The share of light along a direction of cosine c that Smith's function leaves unmasked.
ARHOST_LEAF Float ggx_unmasked(Float cosine, Float alpha) {
    Float a2 = alpha * alpha;
    return Float(2.0) * cosine / max(cosine + sqrt(a2 + (Float(1.0) - a2) * cosine * cosine), Float(1e-7));
}

// What microfacets send to the eye of a lamp's light, by Schlick's term at the microfacet. Lamps' intensities have
// Lambert's π in them.
ARHOST_LEAF Float ggx_lobe(Float cosine_light, Float cosine_eye, Float cosine_half, Float alpha) {
    return Float(3.14159265358979) * cosine_light * ggx_distribution(cosine_half, alpha) *
           ggx_visibility(cosine_light, max(cosine_eye, Float(1e-4)), alpha);
}
