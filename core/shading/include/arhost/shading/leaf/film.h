// SPDX-License-Identifier: Apache-2.0
// Interference in thin layers, which gives them colours. A leaf file: see ../scalar.hpp.
// L. Belcour and P. Barla, A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence,
// SIGGRAPH 2017, as simplified by glTF's KHR_materials_iridescence: unpolarized light, and Schlick's term for the
// surface under the film.

// A band of the spectral response of an observer, as a function of the difference of two optical paths (a Gaussian in
// its Fourier transform). `frequency`: 1/μm.
ARHOST_LEAF Float film_band(Float path_um, Float amplitude, Float frequency, Float damping) {
    return amplitude * cosine_of_turn(frequency * path_um) * exp2(-(damping * path_um * path_um));
}

// The response to interference as a linear colour (Rec. 709). `sign`: −1 in channels whose phase is shifted by half a
// turn.
ARHOST_LEAF Vec3 film_interference(Float path_um, Vec3 sign) {
    Float x = (film_band(path_um, Float(0.846590), Float(1.6810), Float(0.246491)) +
               film_band(path_um, Float(0.153868), Float(2.2399), Float(0.257905))) *
              sign.x;
    Float y = film_band(path_um, Float(1.000222), Float(1.7953), Float(0.529946)) * sign.y;
    Float z = film_band(path_um, Float(1.001122), Float(2.2084), Float(0.376594)) * sign.z;
    return vec3(Float(3.2404542) * x - Float(1.5371385) * y - Float(0.4985314) * z,
                Float(1.8760108) * y - Float(0.9692660) * x + Float(0.0415560) * z,
                Float(0.0556434) * x - Float(0.2040259) * y + Float(1.0572252) * z);
}

// One channel of film_reflectance(). `through`: share of the light that passes the outer surface of the film;
// `outer`, `inner`: reflectances of its two surfaces; `first`, `second`: film_interference() of one and of two paths.
ARHOST_LEAF Float film_channel(Float through, Float outer, Float inner, Float first, Float second) {
    Float both = min(max(outer * inner, Float(0.0)), Float(0.9999));
    Float amplitude = sqrt(both);
    Float rest = through * through * inner / (Float(1.0) - both);
    Float wave = (rest - through) * amplitude * Float(2.0);
    return min(max(outer + rest + wave * (first + amplitude * second), Float(0.0)), Float(1.0));
}

// The refractive index of a material of the reflectance `f0` at normal incidence.
ARHOST_LEAF Float index_of_reflectance(Float f0) {
    Float root = sqrt(min(max(f0, Float(0.0)), Float(0.9999)));
    return (Float(1.0) + root) / (Float(1.0) - root);
}

// Reflectance of a surface under a film. `f0`: of the surface without the film, at normal incidence; `index`: of the
// film; `cosine`: of the angle between the light and the normal.
ARHOST_LEAF Vec3 film_reflectance(Vec3 f0, Float index, Float thickness_nm, Float cosine) {
    Float c = min(max(cosine, Float(0.0)), Float(1.0));
    // A film of no thickness has no effect.
    Float n = Float(1.0) + (index - Float(1.0)) * min(thickness_nm * Float(33.0), Float(1.0));
    Float inside = sqrt(max(Float(1.0) - (Float(1.0) - c * c) / (n * n), Float(0.0)));
    Float outer = dielectric_reflectance(c, inside * inside, Float(1.0) / n);
    Vec3 below = vec3(index_of_reflectance(f0.x), index_of_reflectance(f0.y), index_of_reflectance(f0.z));
    Vec3 inner = schlick(
        vec3(normal_reflectance(below.x / n), normal_reflectance(below.y / n), normal_reflectance(below.z / n)),
        inside);
    // Light is shifted by half a turn where it is reflected by the material of the higher index.
    Vec3 sign = vec3(select(below.x < n, Float(1.0), Float(-1.0)), select(below.y < n, Float(1.0), Float(-1.0)),
                     select(below.z < n, Float(1.0), Float(-1.0)));
    Float path_um = n * thickness_nm * inside * Float(0.002);
    Vec3 first = film_interference(path_um, sign);
    Vec3 second = film_interference(path_um * Float(2.0), vec3(Float(1.0), Float(1.0), Float(1.0)));
    Float through = Float(1.0) - outer;
    return vec3(film_channel(through, outer, inner.x, first.x, second.x),
                film_channel(through, outer, inner.y, first.y, second.y),
                film_channel(through, outer, inner.z, first.z, second.z));
}

// The reflectance at normal incidence with which Schlick's term, with `f90` at grazing incidence, gives `reflectance`
// at an angle; the nearest from 0 to 1.
ARHOST_LEAF Float schlick_inverse(Float reflectance, Float f90, Float cosine) {
    Float c = Float(1.0) - min(max(cosine, Float(0.02)), Float(1.0));
    Float c2 = c * c;
    Float grazing = c2 * c2 * c;
    return min(max((reflectance - f90 * grazing) / (Float(1.0) - grazing), Float(0.0)), Float(1.0));
}
