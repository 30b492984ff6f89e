// SPDX-License-Identifier: Apache-2.0
//
// Direct light from lamps and the environment, and its occlusion. Equivalent to rt_embree's kernel/lights.inl.

// The light that arrives at a surface point from one sampled point of a light source.
struct Incidence {
    vec3 to_light;    // vector from the surface to the sampled point; of unit length if the light is infinitely far
    float t_max;      // end of the shadow ray in lengths of `to_light`: 1, or infinity
    vec3 direction;   // of `to_light`, unit length
    float cosine;     // cosine of the angle of incidence; 0 if the light is behind the surface
    float irradiance; // at perpendicular incidence, per unit of intensity
    vec3 intensity;
    bool from_environment;
};

Incidence incidence_along(Surface s, vec3 to_light, float t_max, float irradiance, vec3 intensity) {
    vec3 direction = normalize(to_light);
    return Incidence(to_light, t_max, direction, lambert_on_facet(s.normal, s.geometric_normal, direction), irradiance,
                     intensity, false);
}

bool is_extended(uint lamp) {
    return lights[lamp].type == RECTANGLE_LIGHT || lights[lamp].type == SPHERE_LIGHT;
}

// `sample_uv` selects the sampled point of an area light.
Incidence incidence(uint lamp, Surface s, vec2 sample_uv) {
    uint type = lights[lamp].type;
    vec3 intensity = lights[lamp].intensity, axis = lights[lamp].direction;
    if (type == DIRECTIONAL_LIGHT)
        return incidence_along(s, -axis, INFINITY, 1.0, intensity);
    vec3 to_light = lights[lamp].position - s.position;
    if (type == RECTANGLE_LIGHT)
        to_light = vector_to_rectangle(to_light, lights[lamp].axis_u, lights[lamp].axis_v, sample_uv.x, sample_uv.y);
    else if (type == SPHERE_LIGHT)
        to_light = vector_to_disc(to_light, lights[lamp].radius, sample_uv.x, sample_uv.y);
    bool falls_off = lights[lamp].falloff == FALLOFF_INVERSE_SQUARE;
    Incidence arriving = incidence_along(s, to_light, 1.0, point_light_falloff(falls_off, dot(to_light, to_light)), intensity);
    if (type == SPOT_LIGHT)
        arriving.irradiance *= spot_attenuation(dot(axis, -arriving.direction), lights[lamp].cosine_inner,
                                          lights[lamp].cosine_outer);
    if (type == RECTANGLE_LIGHT)
        arriving.irradiance *= lambert(axis, -arriving.direction);
    return arriving;
}

// The visibility of a light source from a surface point.
struct Visibility {
    bool is_unoccluded; // no opaque object is in between
    bool is_tinted;     // glass is in between
    vec3 tint;          // transmittance of the glass in between
};

// Traces shadow rays. Real surfaces (catchers and occluders) cast no virtual shadow on each other: the video already
// shows their shadows. The first ray searches for opaque objects; each further ray leads from one glass surface to
// the next. A single loop traces all of them, because trace() is inlined and its code is long.
Visibility visibility(Incidence arriving, Surface s) {
    const int max_surfaces = 64; // ignores further surfaces: rays may alternate endlessly between coincident faces
    vec3 start = s.position + s.geometric_normal * s.offset, to_light = arriving.to_light;
    bool is_finite_distance = arriving.t_max < INFINITY;
    uint mask = s.is_real ? OPAQUE_MASK : OPAQUE_MASK | CATCHER_MASK | OCCLUDER_MASK;
    Ray ray = Ray(start, is_finite_distance ? to_light - s.geometric_normal * s.offset : to_light, arriving.t_max, mask);
    Visibility result = Visibility(false, false, vec3(1.0));
    for (int i = 0; i <= max_surfaces; ++i) {
        Hit hit = trace(ray, i == 0, false);
        bool is_hit = hit.object != NONE;
        if (i == 0)
            result.is_unoccluded = !is_hit;
        if (!has_glass || is_hit == (i == 0))
            break;
        if (i > 0) {
            result.is_tinted = true;
            Surface glass = surface_at(ray, hit, false);
            result.tint *= glass_shadow(materials[objects[hit.object].material].shadow_attenuation,
                                     abs(dot(glass.normal, arriving.direction)));
            if (!(largest(result.tint) > 1e-3))
                break;
            // The next ray starts behind the glass surface.
            vec3 next = glass.position - glass.geometric_normal * glass.offset;
            if (is_finite_distance)
                to_light -= next - start;
            start = next;
        }
        ray = Ray(start, to_light, arriving.t_max, GLASS_MASK);
    }
    return result;
}

// Returns the index (from 0, relative to `first`) of the first cumulative sum above `value`, found by binary search.
int search_sums(uint first, int count, float value) {
    int low = 0, high = count - 1;
    while (low < high) {
        int middle = (low + high) >> 1;
        if (uintBitsToFloat(tables[first + uint(middle)]) > value)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

// Returns cumulative sum i - 1 (0 if i is 0), and the difference between it and cumulative sum i.
vec2 step_of_sums(uint first, int i) {
    float before = i > 0 ? uintBitsToFloat(tables[first + uint(i - 1)]) : 0.0;
    return vec2(before, uintBitsToFloat(tables[first + uint(i)]) - before);
}

vec3 environment_light(vec3 direction) {
    if (frame.environment_texture == NONE)
        return frame.background;
    vec3 d = frame.environment_from_world * direction;
    return sample_texture(frame.environment_texture, vec2(equirectangular_u(d), equirectangular_v(d))).rgb *
           frame.environment_intensity;
}

// Samples a direction in proportion to the environment's luminance. `sample_uv`: random numbers from 0 to 1.
Incidence sample_environment(Surface s, vec2 sample_uv) {
    int width = textures[frame.environment_texture].width, height = textures[frame.environment_texture].height;
    int row = search_sums(frame.environment_rows, height, sample_uv.y);
    vec2 row_step = step_of_sums(frame.environment_rows, row);
    uint first = frame.environment_columns + uint(row * width);
    int column = search_sums(first, width, sample_uv.x);
    vec2 column_step = step_of_sums(first, column);
    float u = (float(column) + fraction_of_step(sample_uv.x, column_step.x, column_step.y)) * (1.0 / float(width));
    float v = (float(row) + fraction_of_step(sample_uv.y, row_step.x, row_step.y)) * (1.0 / float(height));
    // The inverse of a rotation matrix is its transpose.
    vec3 direction = equirectangular_direction(u, v) * frame.environment_from_world;
    float density = equirectangular_density(row_step.y * column_step.y * (float(width) * float(height)), v);
    // The colour is not interpolated, because the density is not: the light of a bright neighbouring texel would be
    // divided by the low density of this texel, which causes bright noise.
    vec3 light = texel_at(frame.environment_texture, column, row).rgb * frame.environment_intensity;
    Incidence arriving = incidence_along(s, direction, INFINITY, irradiance_of_density(density), light);
    arriving.from_environment = true;
    return arriving;
}

// The effect of direct light at a surface point. For shadow catchers: the total irradiance, and the parts of it that
// virtual objects block or tint. For other surfaces: `light`, the radiance towards the ray origin.
struct DirectLight {
    vec3 light;
    float irradiance, blocked, tinted;
    vec3 weighted_alpha; // weighted sum of each channel's alpha; used for coloured shadows only
};

void add_shadow(inout DirectLight sum, Incidence arriving, Visibility visible, float share) {
    float power = arriving.intensity.x + arriving.intensity.y + arriving.intensity.z;
    float weight = arriving.cosine * arriving.irradiance * power * share;
    sum.irradiance += weight;
    if (!visible.is_unoccluded)
        sum.blocked += weight;
    else if (visible.is_tinted)
        sum.tinted += weight;
    vec3 opaque = vec3(frame.shadow_alpha_opaque);
    vec3 through = visible.is_tinted ? opaque * (vec3(1.0) - visible.tint) : vec3(0.0);
    sum.weighted_alpha += (visible.is_unoccluded ? through : opaque) * weight;
}

void add_reflected(inout DirectLight sum, Surface s, vec3 to_eye, Incidence arriving, Visibility visible, float share) {
    vec3 reflected = s.diffuse * arriving.cosine;
    if (s.is_rough) {
        vec3 half_vector = normalize(arriving.direction + to_eye);
        vec3 fresnel = schlick(s.specular, dot(to_eye, half_vector));
        reflected *= vec3(1.0) - fresnel;
        // The secondary ray adds the specular reflection of the environment.
        if (!arriving.from_environment)
            reflected +=
                fresnel * ggx_lobe(arriving.cosine, dot(s.normal, to_eye), dot(s.normal, half_vector), s.alpha);
    } else if (s.exponent > 0.0) {
        reflected += s.specular * phong(s.normal, arriving.direction, to_eye, s.exponent);
    }
    sum.light += reflected * visible.tint * arriving.intensity * (arriving.irradiance * share);
}

DirectLight direct_light(Surface s, vec3 to_eye, bool catches, Random random) {
    DirectLight sum = DirectLight(s.ambient * frame.ambient + s.emission, 0.0, 0.0, 0.0, vec3(0.0));
    uint count = frame.light_count + (frame.environment_texture != NONE ? 1u : 0u);
    for (uint lamp = 0u; lamp < count; ++lamp) {
        bool is_environment = lamp == frame.light_count;
        bool has_points = is_environment || is_extended(lamp);
        uint point_count = has_points ? frame.light_samples : 1u;
        float share = 1.0 / float(point_count);
        for (uint point = 0u; point < point_count; ++point) {
            uint purpose = is_environment ? ENVIRONMENT_PURPOSE : FIRST_LAMP_PURPOSE + lamp;
            vec2 sample_uv = has_points ? pair(random, purpose, point, point_count) : vec2(0.5);
            Incidence arriving;
            if (is_environment)
                arriving = sample_environment(s, sample_uv);
            else
                arriving = incidence(lamp, s, sample_uv);
            if (!(arriving.cosine > 0.0) || !(catches || arriving.irradiance > 0.0))
                continue;
            Visibility visible = visibility(arriving, s);
            if (catches)
                add_shadow(sum, arriving, visible, share);
            else if (visible.is_unoccluded)
                add_reflected(sum, s, to_eye, arriving, visible, share);
        }
    }
    return sum;
}

// Returns the overlay's linear colour and alpha at a shadow catcher.
vec4 catcher_shadow(DirectLight sum) {
    if (frame.coloured_shadows == 0u)
        return vec4(vec3(0.0), shadow_alpha(fraction_of_light(sum.blocked, sum.irradiance),
                                            fraction_of_light(sum.tinted, sum.irradiance),
                                            frame.shadow_alpha_opaque, frame.shadow_alpha_translucent));
    // Each colour channel has its own alpha, but the image has one alpha for all: the largest. The shadow's colour
    // compensates for channels that this alpha would darken too much.
    vec3 alphas = vec3(fraction_of_light(sum.weighted_alpha.x, sum.irradiance),
                    fraction_of_light(sum.weighted_alpha.y, sum.irradiance),
                    fraction_of_light(sum.weighted_alpha.z, sum.irradiance));
    float alpha = largest(alphas);
    return vec4(srgb_decode(shadow_colour_encoded(alphas.x, alpha)), srgb_decode(shadow_colour_encoded(alphas.y, alpha)),
                srgb_decode(shadow_colour_encoded(alphas.z, alpha)), alpha);
}
