// SPDX-License-Identifier: Apache-2.0
//
// What lamps and the environment send to surfaces, and what keeps it from them (rt_embree's kernel/lights.inl).

// One point of a light, as a surface point sees it.
struct Incidence {
    vec3 way;         // to the light, as far as it is; of length 1 to what is infinitely far
    float end;        // of the way: 1, or infinity
    vec3 direction;   // length 1
    float cosine;     // of the surface's inclination; 0 where the light is behind it
    float irradiance; // per unit of intensity, at cosine 1
    vec3 intensity;
    bool from_environment;
};

Incidence incidence_along(Surface s, vec3 way, float end, float irradiance, vec3 intensity) {
    vec3 direction = normalize(way);
    return Incidence(way, end, direction, lambert_on_facet(s.normal, s.geometric_normal, direction), irradiance,
                     intensity, false);
}

bool is_extended(uint lamp) {
    return lights[lamp].type == RECTANGLE_LIGHT || lights[lamp].type == SPHERE_LIGHT;
}

// `where` chooses the point of an extended light.
Incidence incidence(uint lamp, Surface s, vec2 where) {
    uint type = lights[lamp].type;
    vec3 intensity = lights[lamp].intensity, axis = lights[lamp].direction;
    if (type == DIRECTIONAL_LIGHT)
        return incidence_along(s, -axis, INFINITY, 1.0, intensity);
    vec3 way = lights[lamp].position - s.position;
    if (type == RECTANGLE_LIGHT)
        way = vector_to_rectangle(way, lights[lamp].axis_u, lights[lamp].axis_v, where.x, where.y);
    else if (type == SPHERE_LIGHT)
        way = vector_to_disc(way, lights[lamp].radius, where.x, where.y);
    bool falls_off = lights[lamp].falloff == FALLOFF_INVERSE_SQUARE;
    Incidence arriving = incidence_along(s, way, 1.0, point_light_falloff(falls_off, dot(way, way)), intensity);
    if (type == SPOT_LIGHT)
        arriving.irradiance *= spot_attenuation(dot(axis, -arriving.direction), lights[lamp].cosine_inner,
                                          lights[lamp].cosine_outer);
    if (type == RECTANGLE_LIGHT)
        arriving.irradiance *= lambert(axis, -arriving.direction);
    return arriving;
}

// What comes to a surface point from a light.
struct Passage {
    bool open;      // nothing opaque lies between
    bool is_tinted; // but glass does
    vec3 tint;      // what it lets through
};

// Real surfaces cast no shadow on each other: that one is in the video. First a ray for what is opaque, then one from
// each surface of glass to the next, in one loop: trace() is long.
Passage passage(Incidence arriving, Surface s) {
    const int max_surfaces = 64; // what lies behind them is taken for clear: ends loops between coincident faces
    vec3 start = s.position + s.geometric_normal * s.offset, left = arriving.way;
    bool ends = arriving.end < INFINITY;
    uint mask = s.is_real ? OPAQUE_MASK : OPAQUE_MASK | CATCHER_MASK | OCCLUDER_MASK;
    Ray ray = Ray(start, ends ? left - s.geometric_normal * s.offset : left, arriving.end, mask);
    Passage way = Passage(false, false, vec3(1.0));
    for (int i = 0; i <= max_surfaces; ++i) {
        Hit hit = trace(ray, i == 0, false);
        bool is_hit = hit.object != NONE;
        if (i == 0)
            way.open = !is_hit;
        if (!has_glass || is_hit == (i == 0))
            break;
        if (i > 0) {
            way.is_tinted = true;
            Surface glass = surface_at(ray, hit, false);
            way.tint *= glass_shadow(materials[objects[hit.object].material].shadow_attenuation,
                                     abs(dot(glass.normal, arriving.direction)));
            if (!(largest(way.tint) > 1e-3))
                break;
            // On behind it.
            vec3 next = glass.position - glass.geometric_normal * glass.offset;
            if (ends)
                left -= next - start;
            start = next;
        }
        ray = Ray(start, left, arriving.end, GLASS_MASK);
    }
    return way;
}

// The place of `value` in cumulative sums: the first that is larger.
int search(uint first, int count, float value) {
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

// The sum before a place, and what the place adds.
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

// A direction chosen by the environment's brightness.
Incidence sample_environment(Surface s, vec2 where) {
    int width = textures[frame.environment_texture].width, height = textures[frame.environment_texture].height;
    int row = search(frame.environment_rows, height, where.y);
    vec2 row_step = step_of_sums(frame.environment_rows, row);
    uint first = frame.environment_columns + uint(row * width);
    int column = search(first, width, where.x);
    vec2 column_step = step_of_sums(first, column);
    float u = (float(column) + fraction_of_step(where.x, column_step.x, column_step.y)) * (1.0 / float(width));
    float v = (float(row) + fraction_of_step(where.y, row_step.x, row_step.y)) * (1.0 / float(height));
    // The rotation's transpose is its inverse.
    vec3 way = equirectangular_direction(u, v) * frame.environment_from_world;
    float density = equirectangular_density(row_step.y * column_step.y * (float(width) * float(height)), v);
    // The texel's own, as the density is: between texels the mixed light would be too much for the darker one's.
    vec3 light = texel_at(frame.environment_texture, column, row).rgb * frame.environment_intensity;
    Incidence arriving = incidence_along(s, way, INFINITY, irradiance_of_density(density), light);
    arriving.from_environment = true;
    return arriving;
}

// The light that surfaces other than mirrors and glass send back along the ray; or of catchers, how much of the light
// that they would receive is hidden by virtual objects.
struct Gathered {
    vec3 light;
    float irradiance, hidden_part, tinted_part;
    vec3 weighted_colour; // by channel, with coloured shadows
};

void add_shadow(inout Gathered sum, Incidence arriving, Passage way, float share) {
    float power = arriving.intensity.x + arriving.intensity.y + arriving.intensity.z;
    float weight = arriving.cosine * arriving.irradiance * power * share;
    sum.irradiance += weight;
    if (!way.open)
        sum.hidden_part += weight;
    else if (way.is_tinted)
        sum.tinted_part += weight;
    vec3 opaque = vec3(frame.shadow_alpha_opaque);
    vec3 through = way.is_tinted ? opaque * (vec3(1.0) - way.tint) : vec3(0.0);
    sum.weighted_colour += (way.open ? through : opaque) * weight;
}

void add_reflected(inout Gathered sum, Surface s, vec3 to_eye, Incidence arriving, Passage way, float share) {
    vec3 reflected = s.diffuse * arriving.cosine;
    if (s.is_rough) {
        vec3 half_way = normalize(arriving.direction + to_eye);
        vec3 fresnel = schlick(s.specular, dot(to_eye, half_way));
        reflected *= vec3(1.0) - fresnel;
        // The environment's glint comes with the ray that goes on from here.
        if (!arriving.from_environment)
            reflected +=
                fresnel * ggx_lobe(arriving.cosine, dot(s.normal, to_eye), dot(s.normal, half_way), s.alpha);
    } else if (s.exponent > 0.0) {
        reflected += s.specular * phong(s.normal, arriving.direction, to_eye, s.exponent);
    }
    sum.light += reflected * way.tint * arriving.intensity * (arriving.irradiance * share);
}

Gathered gathered(Surface s, vec3 to_eye, bool catches, Random random) {
    Gathered sum = Gathered(s.ambient * frame.ambient + s.emission, 0.0, 0.0, 0.0, vec3(0.0));
    uint count = frame.light_count + (frame.environment_texture != NONE ? 1u : 0u);
    for (uint lamp = 0u; lamp < count; ++lamp) {
        bool is_environment = lamp == frame.light_count;
        bool has_points = is_environment || is_extended(lamp);
        uint points = has_points ? frame.light_samples : 1u;
        float share = 1.0 / float(points);
        for (uint point = 0u; point < points; ++point) {
            uint purpose = is_environment ? ENVIRONMENT_PURPOSE : FIRST_LAMP_PURPOSE + lamp;
            vec2 where = has_points ? pair(random, purpose, point, points) : vec2(0.5);
            Incidence arriving;
            if (is_environment)
                arriving = sample_environment(s, where);
            else
                arriving = incidence(lamp, s, where);
            if (!(arriving.cosine > 0.0) || !(catches || arriving.irradiance > 0.0))
                continue;
            Passage way = passage(arriving, s);
            if (catches)
                add_shadow(sum, arriving, way, share);
            else if (way.open)
                add_reflected(sum, s, to_eye, arriving, way, share);
        }
    }
    return sum;
}

// What lies over the video where a catcher is: its colour, linear, and its alpha.
vec4 caught_shadow(Gathered sum) {
    if (frame.coloured_shadows == 0u)
        return vec4(vec3(0.0), shadow_alpha(fraction_of_light(sum.hidden_part, sum.irradiance),
                                            fraction_of_light(sum.tinted_part, sum.irradiance),
                                            frame.shadow_alpha_opaque, frame.shadow_alpha_translucent));
    // Each channel's own alpha; the colour makes up for what the common one takes too much.
    vec3 own = vec3(fraction_of_light(sum.weighted_colour.x, sum.irradiance),
                    fraction_of_light(sum.weighted_colour.y, sum.irradiance),
                    fraction_of_light(sum.weighted_colour.z, sum.irradiance));
    float alpha = largest(own);
    return vec4(srgb_decode(shadow_colour_encoded(own.x, alpha)), srgb_decode(shadow_colour_encoded(own.y, alpha)),
                srgb_decode(shadow_colour_encoded(own.z, alpha)), alpha);
}
