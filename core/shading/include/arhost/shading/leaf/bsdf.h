// SPDX-License-Identifier: Apache-2.0
// How surfaces scatter light. A leaf file: see ../scalar.hpp.
// All directions have length 1 and point away from the surface, but for the incident one of a mirror.

// Lambert: the share of a light's irradiance that an inclined surface receives (Lambert 1760).
ARHOST_LEAF Float lambert(Vec3 normal, Vec3 to_light) {
    return max(dot(normal, to_light), Float(0.0));
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
