// SPDX-License-Identifier: Apache-2.0
//
// Calls every leaf function of arhost/shading/ with arguments from an array. This file must be included inside a
// namespace that already includes the leaf files. That namespace defines Float, which is a scalar or a packet.

// The number of Floats in a parameter or result type of a leaf function. All these types consist of Floats except
// Bool, which is passed as one Float.
template <class T> constexpr int numbers_of = sizeof(T) / sizeof(Float);
template <> constexpr int numbers_of<Bool> = 1;

template <class T> T value_of(const Float *numbers) {
    T value;
    __builtin_memcpy(&value, numbers, sizeof value);
    return value;
}
template <> Bool value_of<Bool>(const Float *numbers) {
    return *numbers > Float(0.5);
}

template <class...> struct Types {};

template <class F, class... Done> void call(F f, const Float *, Float *results, Types<>, Done... done) {
    const auto value = f(done...);
    __builtin_memcpy(results, &value, sizeof value);
}
template <class F, class Next, class... Left, class... Done>
void call(F f, const Float *arguments, Float *results, Types<Next, Left...>, Done... done) {
    call(f, arguments + numbers_of<Next>, results, Types<Left...>{}, done..., value_of<Next>(arguments));
}

template <class Result, class... Parameters>
void call(Result (*f)(Parameters...), const Float *arguments, Float *results) {
    call(f, arguments, results, Types<Parameters...>{});
}

// Returns a bit mask of the argument array: bit i is set if a Vec3 begins at index i.
template <class Result, class... Parameters> constexpr unsigned vectors_of(Result (*)(Parameters...)) {
    unsigned vectors = 0;
    [[maybe_unused]] int at = 0;
    ((vectors |= (numbers_of<Parameters> == 3 ? 1u : 0u) << at, at += numbers_of<Parameters>), ...);
    return vectors;
}

struct LeafFunction {
    const char *name;
    void (*call)(const Float *arguments, Float *results);
    unsigned vectors;
};

#define LEAF(name)                                                                                                   \
    LeafFunction {                                                                                                   \
#name, [](const Float *from, Float *to) { call(&name, from, to); }, vectors_of(&name)                        \
    }
const LeafFunction leaf_functions[] = {
    LEAF(fraction_of),
    LEAF(light_under_alpha),
    LEAF(alpha_of_light),
    LEAF(shadow_alpha),
    LEAF(overlay_alpha),
    LEAF(overlay_colour),
    LEAF(shadow_colour_encoded),
    LEAF(code_8bit),
    LEAF(lambert),
    LEAF(phong),
    LEAF(mirror_direction),
    LEAF(mirror_direction_off_facet),
    LEAF(schlick),
    LEAF(schlick_between),
    LEAF(glass_reflectance),
    LEAF(refracted_cosine_squared),
    LEAF(dielectric_reflectance),
    LEAF(refracted_direction),
    LEAF(glass_reflected_fraction),
    LEAF(bouguer),
    LEAF(normal_reflectance),
    LEAF(metallic_reflectance),
    LEAF(metallic_diffuse),
    LEAF(ggx_alpha),
    LEAF(ggx_distribution),
    LEAF(anisotropic_distribution),
    LEAF(anisotropic_masking_divisor),
    LEAF(anisotropic_reflection_density),
    LEAF(anisotropic_lobe),
    LEAF(anisotropic_half_vector),
    LEAF(sheen_roughness_of),
    LEAF(sheen_log_lambda),
    LEAF(sheen_lambda),
    LEAF(sheen_lobe),
    LEAF(sheen_albedo),
    LEAF(film_band),
    LEAF(film_interference),
    LEAF(film_channel),
    LEAF(index_of_reflectance),
    LEAF(film_reflectance),
    LEAF(schlick_inverse),
    LEAF(tangent_of),
    LEAF(reflecting_normal),
    LEAF(ggx_visibility),
    LEAF(ggx_masking_divisor),
    LEAF(ggx_masking),
    LEAF(ggx_reflection_density),
    LEAF(ggx_lobe),
    LEAF(srgb_encode),
    LEAF(srgb_decode),
    LEAF(bounded_radiance),
    LEAF(luminance),
    LEAF(angle_from_up),
    LEAF(equirectangular_u),
    LEAF(equirectangular_v),
    LEAF(equirectangular_sine),
    LEAF(equirectangular_direction),
    LEAF(equirectangular_density),
    LEAF(brown_conrady_radial),
    LEAF(brown_conrady),
    LEAF(kannala_brandt_radius),
    LEAF(kannala_brandt_slope),
    LEAF(kannala_brandt),
    LEAF(point_light_falloff),
    LEAF(spot_attenuation),
    LEAF(density_over_area),
    LEAF(distance_to_rectangle),
    LEAF(distance_to_disc),
    LEAF(balance_weight),
    LEAF(balance_weight_of_ray),
    LEAF(glass_shadow),
    LEAF(irradiance_of_density),
    LEAF(tangent_axis),
    LEAF(bitangent_axis),
    LEAF(hemisphere_density),
    LEAF(hemisphere_direction),
    LEAF(cosine_direction),
    LEAF(cone_direction),
    LEAF(ggx_visible_normal),
    LEAF(ggx_half_vector),
    LEAF(vector_to_rectangle),
    LEAF(vector_to_disc),
    LEAF(fraction_of_step),
    LEAF(largest),
    LEAF(normalize_or),
    LEAF(offset_from_surface),
    LEAF(facing),
    LEAF(shading_normal),
    LEAF(lift_to_corner),
    LEAF(tangent_along_u),
    LEAF(tangent_along_v),
    LEAF(perturbed_normal),
};
#undef LEAF
