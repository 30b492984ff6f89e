// SPDX-License-Identifier: Apache-2.0
//
// Direct light from lamps and the environment, and its occlusion. Equivalent to rt_embree's kernel/lights.inl.

// Expected number of light samples of an area light at the vertex of a path after which it has `depth` bounces; each
// integrator defines it.
float light_samples_of(uint lamp, uint depth);

// The light that arrives at a surface point from one sampled point of a light source.
struct LightSample {
    vec3 to_light;    // vector from the surface to the sampled point; of unit length if the light is infinitely far
    float t_max;      // end of the shadow ray in lengths of `to_light`: 1, or infinity
    vec3 direction;   // unit vector in the direction of `to_light`
    float cosine;     // cosine of the angle of incidence; 0 if the light is behind the surface
    float irradiance; // irradiance at perpendicular incidence, per unit of intensity
    vec3 intensity;
    // Number of samples of the light source times the density of one sample per steradian; 0 if reflected rays cannot
    // hit the light source.
    float sampling_density;
    bool is_background; // visible in reflections only
};

LightSample make_light_sample(Surface s, vec3 to_light, float t_max, float irradiance, vec3 intensity) {
    vec3 direction = normalize(to_light);
    return LightSample(to_light, t_max, direction, lambert(s.normal, direction), irradiance, intensity, 0.0, false);
}

bool is_area_light(uint lamp) {
    return lights[lamp].type == RECTANGLE_LIGHT || lights[lamp].type == SPHERE_LIGHT ||
           (lights[lamp].type == SPOT_LIGHT && lights[lamp].radius > 0.0);
}

// `to_light`: unit vector.
float spot_share(uint lamp, vec3 to_light) {
    return spot_attenuation(dot(lights[lamp].direction, -to_light), lights[lamp].cosine_inner,
                            lights[lamp].cosine_outer);
}

// Returns, for a point of an area light, the irradiance per unit of intensity (x) and the density per steradian of one
// sample (y). `to_centre`, `to_point`: vectors to the light's centre and to the point.
vec2 arriving_from_point(uint lamp, vec3 to_centre, vec3 to_point) {
    vec3 direction = normalize(to_point);
    float distance_squared = dot(to_point, to_point);
    float falloff = point_light_falloff(lights[lamp].falloff == FALLOFF_INVERSE_SQUARE, distance_squared);
    if (lights[lamp].type != RECTANGLE_LIGHT) {
        float area = 3.14159265 * lights[lamp].radius * lights[lamp].radius;
        return vec2(falloff, density_over_area(distance_squared, area, dot(normalize(to_centre), direction)));
    }
    vec3 axis_u = lights[lamp].axis_u, axis_v = lights[lamp].axis_v;
    float area = 4.0 * sqrt(dot(axis_u, axis_u) * dot(axis_v, axis_v));
    float cosine = lambert(lights[lamp].direction, -direction);
    return vec2(falloff * cosine, density_over_area(distance_squared, area, cosine));
}

// `sample_uv` selects the sampled point of an area light. `count`: number of samples of the area light.
LightSample sample_light(uint lamp, Surface s, vec2 sample_uv, uint count) {
    uint type = lights[lamp].type;
    vec3 intensity = lights[lamp].intensity;
    if (type == DIRECTIONAL_LIGHT)
        return make_light_sample(s, -lights[lamp].direction, INFINITY, 1.0, intensity);
    vec3 to_centre = lights[lamp].position - s.position;
    LightSample result;
    if (is_area_light(lamp)) {
        vec3 to_point = type == RECTANGLE_LIGHT
                            ? vector_to_rectangle(to_centre, lights[lamp].axis_u, lights[lamp].axis_v, sample_uv.x,
                                                  sample_uv.y)
                            : vector_to_disc(to_centre, lights[lamp].radius, sample_uv.x, sample_uv.y);
        vec2 arriving = arriving_from_point(lamp, to_centre, to_point);
        result = make_light_sample(s, to_point, 1.0, arriving.x, intensity);
        result.sampling_density = arriving.y * float(count);
    } else {
        bool falls_off = lights[lamp].falloff == FALLOFF_INVERSE_SQUARE;
        result = make_light_sample(s, to_centre, 1.0, point_light_falloff(falls_off, dot(to_centre, to_centre)),
                                   intensity);
    }
    if (type == SPOT_LIGHT)
        result.irradiance *= spot_share(lamp, result.direction);
    return result;
}

// Returns the light that a secondary ray receives from area lights before `t_max`, where the ray hits a surface. Lamps
// do not hide each other or anything else. `inverse_density`: see Path. After a reflection off a rough surface, mirrors
// and glass on the path are ignored in the weight, as if the lamp were seen directly. Otherwise, the few random rays
// that find a small lamp along such a path would cause bright spots. `depth`: number of bounces of the path.
vec3 arriving_from_area_lights(vec3 origin, vec3 direction, float t_max, float inverse_density, uint depth) {
    vec3 sum = vec3(0.0);
    for (uint lamp = 0u; lamp < frame.light_count; ++lamp) {
        if (!is_area_light(lamp))
            continue;
        vec3 to_centre = lights[lamp].position - origin;
        float t = lights[lamp].type == RECTANGLE_LIGHT
                      ? distance_to_rectangle(to_centre, lights[lamp].direction, lights[lamp].axis_u,
                                              lights[lamp].axis_v, direction)
                      : distance_to_disc(to_centre, lights[lamp].radius, direction);
        if (!(t > 0.0) || !(t < t_max))
            continue;
        vec2 arriving = arriving_from_point(lamp, to_centre, direction * t);
        if (lights[lamp].type == SPOT_LIGHT)
            arriving.x *= spot_share(lamp, direction);
        float sampled = arriving.y * light_samples_of(lamp, depth);
        sum += lights[lamp].intensity * (arriving.x * arriving.y * 3.14159265 *
                                         balance_weight_of_ray(sampled, abs(inverse_density)));
    }
    return sum;
}

// The visibility of a light source from a surface point.
struct Visibility {
    bool unoccluded; // no opaque object is in between
    bool is_tinted;  // glass is in between
    vec3 tint;       // transmittance of the glass in between
};

// Traces shadow rays. Real surfaces (catchers and occluders) cast no virtual shadow on each other: the video already
// shows their shadows. The first ray searches for opaque objects; each further ray leads from one glass surface to
// the next. A single loop traces all of them, because trace() is inlined and its code is long. `to_light`, `t_max`: as in
// LightSample; `direction`: unit vector along `to_light`.
Visibility visibility(Surface s, vec3 to_light, float t_max, vec3 direction) {
    const int max_surfaces = 64; // ignores further surfaces: rays may alternate endlessly between coincident faces
    vec3 lift = s.lift + s.geometric_normal * s.offset, start = s.position + lift;
    bool is_finite_distance = t_max < INFINITY;
    if (is_finite_distance)
        to_light -= lift;
    uint mask = s.is_real ? OPAQUE_MASK : OPAQUE_MASK | CATCHER_MASK | OCCLUDER_MASK;
    Ray ray = Ray(start, to_light, t_max, mask);
    Visibility result = Visibility(false, false, vec3(1.0));
    for (int i = 0; i <= max_surfaces; ++i) {
        Hit hit = trace(ray, i == 0, false);
        bool is_hit = hit.object != NONE;
        if (i == 0)
            result.unoccluded = !is_hit;
        if (!has_glass || is_hit == (i == 0))
            break;
        if (i > 0) {
            result.is_tinted = true;
            Surface glass = surface_at(ray, hit, false);
            uint material = objects[hit.object].material;
            result.tint *= glass_shadow(materials[material].shadow_attenuation, abs(dot(glass.normal, direction))) *
                           bouguer(materials[material].extinction, glass.back_face ? glass.distance : 0.0);
            if (!(largest(result.tint) > 1e-3))
                break;
            // The next ray starts behind the glass surface.
            vec3 next = glass.position - glass.geometric_normal * glass.offset;
            if (is_finite_distance)
                to_light -= next - start;
            start = next;
        }
        ray = Ray(start, to_light, t_max, GLASS_MASK);
    }
    return result;
}

// Finds the first cumulative sum above `value` by binary search. Returns its index relative to `first`.
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

// Returns the density per steradian of sample_environment() in a texel, computed from the steps of the cumulative sums.
float environment_density(float row_step, float column_step, float v) {
    float texels = float(textures[frame.environment_texture].width) * float(textures[frame.environment_texture].height);
    return equirectangular_density(row_step * column_step * texels, v);
}

// Returns the light that a secondary ray receives from the environment or the background if it hits no surface.
// `inverse_density`: see Path. `samples`: the expected number of light samples of the environment or background.
vec3 arriving_from_environment(vec3 direction, float inverse_density, float samples) {
    inverse_density = max(inverse_density, 0.0); // negative after a mirror; shadow rays do not follow mirrors
    vec3 light = frame.background;
    float density = hemisphere_density();
    if (frame.environment_texture != NONE) {
        vec3 d = frame.environment_from_world * direction;
        vec2 at = vec2(equirectangular_u(d), equirectangular_v(d));
        light = sample_level(frame.environment_texture, 0, at).rgb * frame.environment_intensity;
        if (inverse_density > 0.0) {
            ivec2 size = ivec2(textures[frame.environment_texture].width, textures[frame.environment_texture].height);
            ivec2 texel = ivec2(clamp(at * vec2(size), vec2(0.0), vec2(size - 1)));
            density = environment_density(
                step_of_sums(frame.environment_rows, texel.y).y,
                step_of_sums(frame.environment_columns + uint(texel.y * size.x), texel.x).y, at.y);
        }
    }
    return light * balance_weight_of_ray(density * samples, inverse_density);
}

// Samples a direction of the hemisphere uniformly, in a scene without an environment.
LightSample sample_background(Surface s, vec2 sample_uv, uint count) {
    vec3 direction = hemisphere_direction(s.normal, sample_uv.x, sample_uv.y);
    LightSample arriving =
        make_light_sample(s, direction, INFINITY, irradiance_of_density(hemisphere_density()), frame.background);
    arriving.sampling_density = hemisphere_density() * float(count);
    arriving.is_background = true;
    return arriving;
}

// Samples a direction in proportion to the environment's luminance. `sample_uv`: random numbers from 0 to 1.
LightSample sample_environment(Surface s, vec2 sample_uv, uint count) {
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
    float density = environment_density(row_step.y, column_step.y, v);
    vec3 light = sample_level(frame.environment_texture, 0, vec2(u, v)).rgb * frame.environment_intensity;
    LightSample arriving = make_light_sample(s, direction, INFINITY, irradiance_of_density(density), light);
    arriving.sampling_density = density * float(count);
    return arriving;
}

// The effect of direct light at a surface point. For shadow catchers, it is the total irradiance, and the parts of the
// irradiance that virtual objects hide (Sums.hidden). For other surfaces, it is `light`, the radiance towards the ray
// origin.
struct DirectLight {
    vec3 light, hidden;
    float irradiance;
};

void add_shadow(inout DirectLight sum, LightSample arriving, Visibility visible, float share) {
    float power = arriving.intensity.x + arriving.intensity.y + arriving.intensity.z;
    float weight = arriving.cosine * arriving.irradiance * power * share;
    float hidden = visible.unoccluded ? 0.0 : weight, tinted = visible.is_tinted ? weight : 0.0;
    sum.irradiance += weight;
    if (frame.coloured_shadows != 0u)
        sum.hidden += hidden + (vec3(1.0) - visible.tint) * tinted;
    else
        sum.hidden += vec3(hidden, tinted, 0.0);
}

// Returns the share of the arriving light that a rough surface reflects to the eye, without the Fresnel term. A
// randomly reflected ray can reach the same light source; balance_weight() divides the light between the sample and
// that ray. Environment light that passes through glass is counted only along reflected rays, not for samples.
float rough_lobe(Surface s, vec3 to_eye, vec3 half_vector, LightSample arriving, Visibility visible, bool rays_follow) {
    float cosine_eye = dot(s.normal, to_eye), cosine_half = dot(s.normal, half_vector);
    float lobe = ggx_lobe(arriving.cosine, cosine_eye, cosine_half, s.alpha);
    if (!rays_follow)
        return lobe;
    if (visible.is_tinted && arriving.t_max > 1.0 && arriving.sampling_density > 0.0)
        return 0.0;
    bool reflects = dot(s.geometric_normal, arriving.direction) > 0.0;
    float density = reflects ? ggx_reflection_density(cosine_eye, cosine_half, s.alpha) : 0.0;
    return lobe * balance_weight(arriving.sampling_density, density);
}

void add_reflected(inout DirectLight sum, Surface s, vec3 to_eye, LightSample arriving, Visibility visible,
                   bool rays_follow, float share) {
    vec3 reflected = s.diffuse * arriving.cosine;
    if (s.is_rough) {
        vec3 half_vector = normalize(arriving.direction + to_eye);
        vec3 fresnel = fresnel_of(s, dot(to_eye, half_vector));
        vec3 diffuse = arriving.is_background ? vec3(0.0) : reflected * passing_fresnel(s, dot(to_eye, half_vector));
        reflected = diffuse + fresnel * rough_lobe(s, to_eye, half_vector, arriving, visible, rays_follow);
    } else if (s.exponent > 0.0) {
        reflected += s.specular * phong(s.normal, arriving.direction, to_eye, s.exponent);
    }
    sum.light += reflected * visible.tint * arriving.intensity * (arriving.irradiance * share);
}

// `rays_follow`: whether rough surfaces also reflect rays.
DirectLight direct_light(Surface s, vec3 to_eye, bool catches, bool rays_follow, Random random) {
    DirectLight sum = DirectLight(s.ambient * frame.ambient + s.emission, vec3(0.0), 0.0);
    bool has_environment = frame.environment_texture != NONE;
    bool background = !catches && s.is_rough && largest(frame.background) > 0.0;
    uint count = frame.light_count + (has_environment || background ? 1u : 0u);
    for (uint lamp = 0u; lamp < count; ++lamp) {
        bool is_lamp = lamp < frame.light_count, has_points = !is_lamp || is_area_light(lamp);
        uint point_count = has_points ? frame.light_samples : 1u;
        float share = 1.0 / float(point_count);
        for (uint point = 0u; point < point_count; ++point) {
            uint purpose = is_lamp ? FIRST_LAMP_PURPOSE + lamp : ENVIRONMENT_PURPOSE;
            vec2 sample_uv = has_points ? pair(random, purpose, point, point_count) : vec2(0.5);
            LightSample arriving;
            if (is_lamp)
                arriving = sample_light(lamp, s, sample_uv, point_count);
            else if (has_environment)
                arriving = sample_environment(s, sample_uv, point_count);
            else
                arriving = sample_background(s, sample_uv, point_count);
            if (!(arriving.cosine > 0.0) || !(catches || arriving.irradiance > 0.0))
                continue;
            Visibility visible = visibility(s, arriving.to_light, arriving.t_max, arriving.direction);
            if (catches)
                add_shadow(sum, arriving, visible, share);
            else if (visible.unoccluded)
                add_reflected(sum, s, to_eye, arriving, visible, rays_follow, share);
        }
    }
    return sum;
}

// Returns the overlay's sRGB-encoded colour and alpha at a shadow catcher. `fractions`: the fractions of light that are
// hidden (Sums.hidden).
vec4 catcher_shadow(vec3 fractions) {
    float opaque = frame.shadow_alpha_opaque, translucent = frame.shadow_alpha_translucent;
    if (frame.coloured_shadows == 0u)
        return vec4(vec3(0.0), shadow_alpha(fractions.x, fractions.y, opaque, translucent));
    // Each colour channel has its own alpha, but the image has one alpha for all channels: the largest. This alpha
    // would darken the other channels too much, so the shadow's colour compensates for the difference.
    vec3 alphas = vec3(shadow_alpha(fractions.x, 0.0, opaque, translucent),
                       shadow_alpha(fractions.y, 0.0, opaque, translucent),
                       shadow_alpha(fractions.z, 0.0, opaque, translucent));
    float alpha = largest(alphas);
    return vec4(shadow_colour_encoded(alphas.x, alpha), shadow_colour_encoded(alphas.y, alpha),
                shadow_colour_encoded(alphas.z, alpha), alpha);
}
