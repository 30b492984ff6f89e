// SPDX-License-Identifier: Apache-2.0
//
// Light sources of the path integrator: lamps, emissive surfaces and the environment. A light sample chooses one of
// them at random. Equivalent to rt_embree's kernel/path_lights.inl.

// Rows and types of raytracer_common/source_record.hpp.
const uint TYPE_ROW = 0u, POSITION_ROW = 2u, INTENSITY_ROW = 8u, AXIS_U_ROW = 11u, AXIS_V_ROW = 14u, RADIUS_ROW = 17u,
           CHANCE_ROW = 20u, AREA_ROW = 21u, SOURCE_ROWS = 22u;
const uint TRIANGLE_SOURCE = 16u, BALL_SOURCE = 17u;

float source_field(uint source, uint row) {
    return uintBitsToFloat(tables[frame.first_source + SOURCE_ROWS * source + row]);
}
vec3 source_vector(uint source, uint row) {
    return vec3(source_field(source, row), source_field(source, row + 1u), source_field(source, row + 2u));
}

// Number of light samples at a vertex of a path.
uint source_samples(uint depth) {
    return depth == 0u ? frame.light_samples : 1u;
}

float light_samples_of(uint lamp, uint depth) {
    return source_field(lamp, CHANCE_ROW) * float(source_samples(depth - 1u));
}

struct SourceSample {
    vec3 to_light;  // vector from the surface to the sampled point; of unit length if the light is infinitely far
    float t_max;    // end of the shadow ray in lengths of `to_light`
    vec3 direction; // unit vector in the direction of `to_light`
    vec3 light;     // irradiance at perpendicular incidence, divided by π and by the number of samples
    float density;  // expected number of samples per steradian; 0 if scattered rays cannot hit the light source
    bool is_virtual, is_environment;
};

// Returns 1 − cosine of the half angle of the cone around a ball whose angular radius has this squared sine.
float slope_of_cone(float sine_squared) {
    return sine_squared / (1.0 + sqrt(max(1.0 - sine_squared, 0.0)));
}
float density_in_cone(float slope) {
    return 0.159154943 / max(slope, 1e-12);
}

// Returns light sample `index` of `count`. The samples are spread evenly over the light sources.
SourceSample sample_source(Surface s, Random random, uint index, uint count) {
    const float before_source = 0.9999; // shadow rays end before an emissive surface, or one that a lamp is in
    SourceSample result = SourceSample(s.normal, before_source, s.normal, vec3(0.0), 0.0, false, false);
    if (frame.source_count == 0u)
        return result;
    uint source = 0u;
    if (frame.source_count > 1u) {
        float chosen = (path_pair(random, SOURCE_DIMENSION, index, count).x + float(index)) * (1.0 / float(count));
        source = uint(search_sums(frame.first_cumulative, int(frame.source_count), chosen));
    }
    vec2 uv = path_pair(random, LIGHT_DIMENSION, index, count);
    uint type = uint(source_field(source, TYPE_ROW));
    float chance = source_field(source, CHANCE_ROW) * float(count), share = 1.0 / chance;
    if (type == TRIANGLE_SOURCE) {
        vec3 edge_1 = source_vector(source, AXIS_U_ROW), edge_2 = source_vector(source, AXIS_V_ROW);
        float along = sqrt(uv.x); // uniform over the triangle
        result.to_light = source_vector(source, POSITION_ROW) - s.position + edge_1 * (along * (1.0 - uv.y)) +
                          edge_2 * (along * uv.y);
        float cosine = abs(dot(normalize(cross(edge_1, edge_2)), normalize(result.to_light)));
        result.density = density_over_area(dot(result.to_light, result.to_light), source_field(source, AREA_ROW), cosine);
        result.is_virtual = true;
    } else if (type == BALL_SOURCE) {
        vec3 to_centre = source_vector(source, POSITION_ROW) - s.position;
        float radius = source_field(source, RADIUS_ROW), squared = dot(to_centre, to_centre);
        float sine_squared = radius * radius / max(squared, 1e-20), slope = slope_of_cone(sine_squared);
        if (sine_squared < 0.9999) {
            vec3 direction = cone_direction(normalize(to_centre), slope, uv.x, uv.y);
            float along = dot(direction, to_centre);
            float half_chord = sqrt(max(radius * radius - (squared - along * along), 0.0));
            result.to_light = direction * (along - half_chord);
            result.density = density_in_cone(slope);
        }
        result.is_virtual = true;
    } else {
        LightSample arriving;
        if (source < frame.light_count) // the first sources are the lamps
            arriving = sample_light(source, s, uv, 1u);
        else if (frame.environment_texture != NONE)
            arriving = sample_environment(s, uv, 1u);
        else
            arriving = sample_background(s, uv, 1u);
        result.to_light = arriving.to_light;
        if (!(arriving.t_max < INFINITY))
            result.t_max = INFINITY;
        result.is_environment = source >= frame.light_count;
        result.light = arriving.intensity * (arriving.irradiance * share);
        result.density = arriving.sampling_density;
    }
    if (result.is_virtual && result.density > 0.0) // the radiance is known
        result.light = source_vector(source, INTENSITY_ROW) * (irradiance_of_density(result.density) * share);
    result.density *= chance;
    result.direction = normalize(result.to_light);
    return result;
}

// Returns whether no object of these masks hides a light source.
bool is_visible(Surface s, SourceSample source, uint mask) {
    vec3 lift = s.lift + s.geometric_normal * s.offset;
    vec3 to_light = source.t_max < INFINITY ? source.to_light - lift : source.to_light;
    return trace(Ray(s.position + lift, to_light, source.t_max, mask), true, false).object == NONE;
}

// Returns whether the first object towards a light source is virtual.
bool is_virtual_first(Surface s, SourceSample source) {
    Hit hit = trace(Ray(s.position + s.lift + s.geometric_normal * s.offset, source.to_light, source.t_max, ALL_MASKS),
                    false, false);
    return hit.object != NONE && objects[hit.object].role == VIRTUAL;
}

// Expected number of light samples per steradian, at the previous vertex of the path, of an emissive surface that the
// ray hits. `depth`: number of bounces of the path.
float density_of_emitter(Surface s, Hit hit, vec3 direction, uint depth) {
    float per_source = objects[hit.object].emitter_density * float(source_samples(depth - 1u));
    if (!(per_source > 0.0))
        return 0.0;
    if ((objects[hit.object].flags & IS_SPHERES) == 0u)
        return per_source *
               density_over_area(s.distance * s.distance, 1.0, abs(dot(s.geometric_normal, direction)));
    float radius = primitives[hit.primitive].edge_1.x * length(objects[hit.object].transform[0]);
    vec3 to_centre = direction * s.distance + s.geometric_normal * (s.back_face ? radius : -radius);
    float sine_squared = radius * radius / max(dot(to_centre, to_centre), 1e-20);
    return sine_squared < 0.9999 ? per_source * density_in_cone(slope_of_cone(sine_squared)) : 0.0;
}

// Returns the irradiance of a real surface without virtual objects, divided by π: the irradiance map of the
// environment, and a regular grid of points on each lamp, which has fewer points if there are many lamps.
vec3 irradiance_without_objects(Surface s) {
    vec3 sum = frame.background;
    if (frame.environment_texture != NONE) {
        vec3 d = frame.environment_from_world * s.normal;
        sum = sample_level(frame.irradiance_texture, 0, vec2(equirectangular_u(d), equirectangular_v(d))).rgb *
              frame.environment_intensity;
    }
    for (uint lamp = 0u; lamp < frame.light_count; ++lamp) {
        uint side = !is_area_light(lamp) || frame.light_count > 64u ? 1u : frame.light_count > 8u ? 2u : 4u, points = side * side;
        float irradiance = 0.0;
        for (uint i = 0u; i < points; ++i) {
            LightSample arriving = sample_light(lamp, s, (vec2(i / side, i % side) + 0.5) / float(side), 1u);
            irradiance += arriving.irradiance * arriving.cosine;
        }
        sum += lights[lamp].intensity * (irradiance / float(points));
    }
    return sum;
}
