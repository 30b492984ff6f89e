// SPDX-License-Identifier: Apache-2.0
// Fibres above a surface. A leaf file: see ../scalar.hpp.
// A. Estevez and C. Kulla, Production Friendly Microfacet Sheen BRDF, 2017; the values of glTF's KHR_materials_sheen.

// Roughnesses below this one reflect more light than they receive at grazing angles.
ARHOST_LEAF Float sheen_roughness_of(Float roughness) {
    return max(roughness, Float(0.2));
}

// The logarithm of Smith's lambda, fitted for cosines up to one half.
ARHOST_LEAF Float sheen_log_lambda(Float cosine, Float alpha) {
    Float t = (Float(1.0) - alpha) * (Float(1.0) - alpha);
    Float a = Float(21.5473) + Float(3.7772) * t;
    Float b = Float(3.82987) - Float(0.50552) * t;
    Float c = Float(0.19823) - Float(0.03022) * t;
    Float d = Float(-1.97760) + Float(0.70367) * t;
    Float e = Float(-4.32054) - Float(0.53913) * t;
    return a / (Float(1.0) + b * pow(max(cosine, Float(1e-6)), c)) + d * cosine + e;
}
ARHOST_LEAF Float sheen_lambda(Float cosine, Float alpha) {
    Float at_half = sheen_log_lambda(Float(0.5), alpha);
    Float below = sheen_log_lambda(min(cosine, Float(1.0) - cosine), alpha);
    Float logarithm = select(cosine < Float(0.5), below, at_half * Float(2.0) - below);
    return exp2(logarithm * Float(1.44269504088896));
}

// Reflection by white fibres. The factor π is needed because lamp intensities include Lambert's 1/π.
// `alpha`: sheen_roughness_of() squared.
ARHOST_LEAF Float sheen_lobe(Float cosine_light, Float cosine_eye, Float cosine_half, Float alpha) {
    Float inverse = Float(1.0) / alpha;
    Float sine_squared = max(Float(1.0) - cosine_half * cosine_half, Float(1e-6));
    Float charlie = (Float(1.0) + Float(0.5) * inverse) * pow(sine_squared, Float(0.5) * inverse);
    Float to_light = max(cosine_light, Float(1e-4));
    Float to_eye = max(cosine_eye, Float(1e-4));
    Float visible = Float(1.0) / ((Float(1.0) + sheen_lambda(to_light, alpha) + sheen_lambda(to_eye, alpha)) *
                                  Float(4.0) * to_light * to_eye);
    return max(cosine_light, Float(0.0)) * charlie * min(visible, Float(1.0));
}

// The share of the light to the eye that white fibres reflect if light comes from all directions: a fit to integrals
// of sheen_lobe(), with an error of at most 0.01 for cosines above 0.04. `roughness`: sheen_roughness_of().
ARHOST_LEAF Float sheen_albedo(Float cosine, Float roughness) {
    Float c = min(max(cosine, Float(0.0)), Float(1.0));
    Float r = roughness;
    Float a0 = Float(1.373) + r * (Float(-9.931) + r * (Float(18.747) + r * (Float(-14.299) + r * Float(3.758))));
    Float a1 =
        Float(-17.531) + r * (Float(64.521) + r * (Float(-121.858) + r * (Float(112.808) + r * Float(-40.249))));
    Float a2 =
        Float(-11.003) + r * (Float(71.535) + r * (Float(-137.911) + r * (Float(102.289) + r * Float(-24.85))));
    Float a3 = Float(8.439) + r * (Float(-73.881) + r * (Float(172.551) + r * (Float(-157.529) + r * Float(50.438))));
    return min(exp2(a0 + c * (a1 + c * (a2 + c * a3))), Float(1.0));
}
