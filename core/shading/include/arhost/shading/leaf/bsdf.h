// SPDX-License-Identifier: Apache-2.0
// Surface scattering. A leaf file: see ../scalar.hpp.
// All directions have unit length. They point away from the surface, except `incident`, which points at it.

// Lambert's cosine law (Lambert 1760).
ARHOST_LEAF Float lambert(Vec3 normal, Vec3 to_light) {
    return max(dot(normal, to_light), Float(0.0));
}

// Phong: (r·v)^n, where r is the light direction reflected about the normal; 0 for light from behind the surface
// (Phong, Illumination for Computer Generated Pictures, CACM 18(6), 1975).
ARHOST_LEAF Float phong(Vec3 normal, Vec3 to_light, Vec3 to_eye, Float exponent) {
    Float cosine = dot(normal, to_light);
    Vec3 reflected = normal * (Float(2.0) * cosine) - to_light;
    // The clamp avoids pow(0, n). Its effect on the colour is smaller than any colour step.
    Float lobe = pow(max(dot(reflected, to_eye), Float(1e-6)), exponent);
    return select(cosine > Float(0.0), lobe, Float(0.0));
}

// Law of reflection: i − 2 (n·i) n. `incident` points at the surface.
ARHOST_LEAF Vec3 mirror_direction(Vec3 incident, Vec3 normal) {
    return incident - normal * (Float(2.0) * dot(normal, incident));
}

// Mirror direction with an interpolated `normal`: uses the geometric normal `facet` instead if the reflected ray
// would enter the surface.
ARHOST_LEAF Vec3 mirror_direction_off_facet(Vec3 incident, Vec3 normal, Vec3 facet) {
    Vec3 by_normal = mirror_direction(incident, normal);
    return select(dot(by_normal, facet) > Float(0.0), by_normal, mirror_direction(incident, facet));
}

// Schlick's Fresnel approximation: reflectance `f0` at normal incidence, `f90` at grazing incidence
// (Schlick, An Inexpensive BRDF Model for Physically-based Rendering, CGF 13(3), 1994, eq. 15).
ARHOST_LEAF Vec3 schlick_between(Vec3 f0, Float f90, Float cosine) {
    Float c = Float(1.0) - min(max(cosine, Float(0.0)), Float(1.0));
    Float c2 = c * c;
    Float grazing = c2 * c2 * c;
    Float edge = f90 * grazing;
    return f0 * (Float(1.0) - grazing) + vec3(edge, edge, edge);
}
ARHOST_LEAF Vec3 schlick(Vec3 f0, Float cosine) {
    return schlick_between(f0, Float(1.0), cosine);
}

// Reflectance of glass: Schlick's term with configurable exponent and limits (table 2 of the dissertation).
ARHOST_LEAF Float glass_reflectance(Float cosine, Float exponent, Float minimum, Float maximum) {
    // The clamp avoids pow(0, n).
    Float c = max(Float(1.0) - min(max(cosine, Float(0.0)), Float(1.0)), Float(1e-6));
    return min(max(minimum + (Float(1.0) - minimum) * pow(c, exponent), minimum), maximum);
}

// Snell's law: squared cosine of the angle of refraction; negative for total internal reflection. `cosine`: of the
// angle of incidence; `ratio`: refractive index of the incident side divided by that of the transmitted side.
ARHOST_LEAF Float refracted_cosine_squared(Float cosine, Float ratio) {
    return Float(1.0) - ratio * ratio * (Float(1.0) - cosine * cosine);
}

// Direction of the refracted ray. Both cosines are positive; `normal` points to the side of the incident ray.
ARHOST_LEAF Vec3 refracted_direction(Vec3 incident, Vec3 normal, Float ratio, Float cosine, Float refracted_cosine) {
    return incident * ratio + normal * (ratio * cosine - refracted_cosine);
}

// Reflectance of a glass surface: 1 for total internal reflection, otherwise glass_reflectance of the cosine on the
// outside. `cosine`: of the angle of incidence; `refracted_squared`: squared cosine of the angle of refraction.
ARHOST_LEAF Float glass_reflected_fraction(Bool from_inside, Float cosine, Float refracted_squared, Float exponent,
                                           Float minimum, Float maximum) {
    Float refracted = sqrt(max(refracted_squared, Float(0.0)));
    return select(refracted_squared < Float(0.0), Float(1.0),
                  glass_reflectance(select(from_inside, refracted, cosine), exponent, minimum, maximum));
}

// Fresnel's reflectance of a dielectric for unpolarized light; 1 for total internal reflection. `cosine`: of the
// angle of incidence; `refracted_squared`: squared cosine of the angle of refraction; `ratio`: as in
// refracted_cosine_squared (Fresnel 1823; M. Pharr et al., Physically Based Rendering, 4th edition, section 9.3.5).
ARHOST_LEAF Float dielectric_reflectance(Float cosine, Float refracted_squared, Float ratio) {
    Float refracted = sqrt(max(refracted_squared, Float(0.0)));
    Float parallel = (cosine - ratio * refracted) / max(cosine + ratio * refracted, Float(1e-6));
    Float perpendicular = (ratio * cosine - refracted) / max(ratio * cosine + refracted, Float(1e-6));
    Float mean = Float(0.5) * (parallel * parallel + perpendicular * perpendicular);
    return select(refracted_squared < Float(0.0), Float(1.0), mean);
}

// Bouguer–Lambert–Beer law: transmittance exp(−extinction · distance); `extinction` in 1/mm, `distance` in mm
// (Bouguer, Essai d'optique sur la gradation de la lumière, 1729; Lambert 1760, Beer 1852).
ARHOST_LEAF Vec3 bouguer(Vec3 extinction, Float distance) {
    Vec3 power = extinction * (distance * Float(-1.44269504088896)); // exp(x) = exp2(x / ln 2)
    return vec3(exp2(power.x), exp2(power.y), exp2(power.z));
}

// Reflectance of a dielectric at normal incidence (Fresnel 1823). `index`: refractive index.
ARHOST_LEAF Float normal_reflectance(Float index) {
    Float ratio = (index - Float(1.0)) / (index + Float(1.0));
    return ratio * ratio;
}
// Metallic-roughness material (glTF 2.0, appendix B.3). Reflectance at normal incidence: that of the dielectric or,
// for metals, the base colour.
ARHOST_LEAF Vec3 metallic_reflectance(Vec3 dielectric, Vec3 base_colour, Float metallic) {
    return dielectric * (Float(1.0) - metallic) + base_colour * metallic;
}
// Diffuse colour of a metallic-roughness material: black for metals.
ARHOST_LEAF Vec3 metallic_diffuse(Vec3 base_colour, Float metallic) {
    return base_colour * (Float(1.0) - metallic);
}
// GGX's alpha is the roughness squared; the lower bound keeps the distribution finite.
ARHOST_LEAF Float ggx_alpha(Float roughness) {
    return max(roughness * roughness, Float(0.001));
}

// GGX distribution of microfacet normals (glTF 2.0, appendix B; Walter et al., Microfacet Models for Refraction,
// EGSR 2007, eq. 33).
ARHOST_LEAF Float ggx_distribution(Float cosine_half, Float alpha) {
    Float a2 = alpha * alpha;
    Float d = cosine_half * cosine_half * (a2 - Float(1.0)) + Float(1.0);
    return a2 / (Float(3.14159265358979) * d * d);
}

// The divisor d of Smith's masking function G1 = 2c / d. G1 is the fraction of the microfacets that is visible from a
// direction whose angle to the normal has the cosine c.
ARHOST_LEAF Float ggx_masking_divisor(Float cosine, Float alpha) {
    Float a2 = alpha * alpha;
    return cosine + sqrt(a2 + (Float(1.0) - a2) * cosine * cosine);
}

// Smith's masking function for the direction of the light. Only this factor remains if visible microfacets are
// sampled (ggx_half_vector in sampling.h).
ARHOST_LEAF Float ggx_masking(Float cosine, Float alpha) {
    return Float(2.0) * cosine / max(ggx_masking_divisor(cosine, alpha), Float(1e-7));
}

// Smith's separable masking-shadowing function divided by 4 (n·l) (n·v), as in glTF 2.0, appendix B.
ARHOST_LEAF Float ggx_visibility(Float cosine_light, Float cosine_eye, Float alpha) {
    Float divisor = ggx_masking_divisor(cosine_light, alpha) * ggx_masking_divisor(cosine_eye, alpha);
    return Float(1.0) / max(divisor, Float(1e-7));
}

// Density per steradian of directions that are reflected off sampled visible microfacets: G1 D / 4 (n·v). The lobe is
// this density times ggx_masking of the light (times π).
ARHOST_LEAF Float ggx_reflection_density(Float cosine_eye, Float cosine_half, Float alpha) {
    return Float(0.5) * ggx_distribution(cosine_half, alpha) /
           ggx_masking_divisor(max(cosine_eye, Float(1e-4)), alpha);
}

// GGX specular reflection without the Fresnel term. The factor π is needed because lamp intensities include Lambert's
// 1/π.
ARHOST_LEAF Float ggx_lobe(Float cosine_light, Float cosine_eye, Float cosine_half, Float alpha) {
    return Float(3.14159265358979) * cosine_light * ggx_distribution(cosine_half, alpha) *
           ggx_visibility(cosine_light, max(cosine_eye, Float(1e-4)), alpha);
}

// GGX that reflects further along one axis of the surface than along the other (Burley, Physically Based Shading at
// Disney, SIGGRAPH 2012 course notes, section B.2; glTF's KHR_materials_anisotropy). Vectors are in coordinates with
// the surface normal along z; `alpha_x` and `alpha_y` are along x and y. With equal alphas, the functions equal those
// above.
ARHOST_LEAF Float anisotropic_distribution(Vec3 half_vector, Float alpha_x, Float alpha_y) {
    Float x = half_vector.x / alpha_x;
    Float y = half_vector.y / alpha_y;
    Float d = x * x + y * y + half_vector.z * half_vector.z;
    return Float(1.0) / (Float(3.14159265358979) * alpha_x * alpha_y * d * d);
}
ARHOST_LEAF Float anisotropic_masking_divisor(Vec3 direction, Float alpha_x, Float alpha_y) {
    Float x = direction.x * alpha_x;
    Float y = direction.y * alpha_y;
    Float cosine = max(direction.z, Float(1e-4));
    return cosine + sqrt(x * x + y * y + cosine * cosine);
}
ARHOST_LEAF Float anisotropic_reflection_density(Vec3 to_eye, Vec3 half_vector, Float alpha_x, Float alpha_y) {
    return Float(0.5) * anisotropic_distribution(half_vector, alpha_x, alpha_y) /
           anisotropic_masking_divisor(to_eye, alpha_x, alpha_y);
}
ARHOST_LEAF Float anisotropic_lobe(Vec3 to_light, Vec3 to_eye, Vec3 half_vector, Float alpha_x, Float alpha_y) {
    return Float(3.14159265358979) * max(to_light.z, Float(0.0)) *
           anisotropic_distribution(half_vector, alpha_x, alpha_y) /
           (anisotropic_masking_divisor(to_light, alpha_x, alpha_y) *
            anisotropic_masking_divisor(to_eye, alpha_x, alpha_y));
}
