// SPDX-License-Identifier: Apache-2.0
//
// Photons that lamps send onto mirrors and glass. Equivalent to the first half of rt_embree's kernel/photons.inl, with
// the same random numbers.

layout(std430, set = 0, binding = 15) writeonly buffer PhotonWords {
    uint photon_words[]; // nine floats for each photon, as in Photon of raytracer_common
};

const uint PHOTONS_PER_ROW = 1024u; // as photons_per_row in layout.hpp
const uint TARGET_DIMENSION = 128u, ORIGIN_DIMENSION = 129u, AIM_DIMENSION = 130u, FIRST_BOUNCE_DIMENSION = 131u,
           FIRST_FACET_DIMENSION = 256u;

// Returns the random numbers of a dimension of the photon with this number.
vec2 photon_pair(uint number, uint dimension) {
    return vec2(owen_pair(number, hash(dimension)) >> 8) * (1.0 / 16777216.0);
}

// Returns 1 − cosine of the half angle of the cone around a sphere; from inside the sphere, that of all directions.
float slope_of_target(vec4 sphere, vec3 to_centre) {
    float sine_squared = min(sphere.w * sphere.w / max(dot(to_centre, to_centre), 1e-20), 1.0);
    return sine_squared < 1.0 ? slope_of_cone(sine_squared) : 2.0;
}

// Returns the density of the photons of a lamp from `origin` in a direction, per steradian, or of parallel light, per
// area (mm²). `aimed_at`: the sphere that counts in spite of rounding errors.
float density_of_photons(uint lamp, vec3 origin, vec3 direction, uint aimed_at) {
    bool directional = lights[lamp].type == DIRECTIONAL_LIGHT;
    float density = 0.0;
    for (uint i = 0u; i < frame.target_count; ++i) {
        vec4 sphere = frame.targets[i];
        vec3 to_centre = sphere.xyz - origin;
        float slope = slope_of_target(sphere, to_centre), along = dot(to_centre, direction);
        vec3 across = to_centre - direction * along;
        bool in_beam = dot(across, across) < sphere.w * sphere.w || i == aimed_at;
        float chance = uintBitsToFloat(tables[frame.first_target_chance + lamp * frame.target_count + i]);
        if (directional && in_beam)
            density += chance * 0.318309886 / (sphere.w * sphere.w);
        else if (!directional && in_beam && (along > 0.0 || slope > 1.0))
            density += chance * 0.159154943 / slope;
    }
    return density;
}

// Returns the vector to a sphere's centre; from the centre, any vector of 1e-6 mm.
vec3 axis_to_centre(vec3 to) {
    return dot(to, to) > 1e-12 ? to : vec3(0.0, 0.0, 1e-6);
}

// Light that leaves a lamp towards a mirror or glass.
struct EmittedPhoton {
    vec3 origin, direction, power; // the power is 0 if the lamp sends no light in the direction
    bool grows; // a lamp without falloff: the power is to be multiplied by the square of the distance travelled
};

EmittedPhoton emit_photon(uint number) {
    float target = photon_pair(number, TARGET_DIMENSION).x;
    uint chosen = uint(search_sums(frame.first_target, int(frame.target_count * frame.light_count), target));
    uint lamp = chosen / frame.target_count, type = lights[lamp].type;
    chosen %= frame.target_count;
    vec4 sphere = frame.targets[chosen];
    vec2 uv = photon_pair(number, ORIGIN_DIMENSION), aim = photon_pair(number, AIM_DIMENSION);
    vec3 lamp_direction = lights[lamp].direction, origin = lights[lamp].position, direction = lamp_direction;
    if (type == DIRECTIONAL_LIGHT) { // parallel light, from a disc outside of the scene
        origin = sphere.xyz + vector_to_disc(-direction, sphere.w, aim.x, aim.y) + direction -
                 direction * frame.scene_extent;
    } else {
        if (type == RECTANGLE_LIGHT)
            origin = vector_to_rectangle(origin, lights[lamp].axis_u, lights[lamp].axis_v, uv.x, uv.y);
        else if (is_area_light(lamp))
            origin = sphere.xyz + vector_to_disc(axis_to_centre(origin - sphere.xyz), lights[lamp].radius, uv.x, uv.y);
        vec3 to_centre = sphere.xyz - origin;
        direction = cone_direction(normalize(axis_to_centre(to_centre)), slope_of_target(sphere, to_centre), aim.x, aim.y);
    }
    float density = density_of_photons(lamp, origin, direction, chosen);
    float share = density > 0.0 ? 1.0 / max(density * float(frame.photon_count), 1e-30) : 0.0;
    if (type == SPOT_LIGHT)
        share *= spot_share(lamp, -direction);
    if (type == RECTANGLE_LIGHT)
        share *= lambert(lamp_direction, direction);
    return EmittedPhoton(origin, direction, lights[lamp].intensity * share,
                         type != DIRECTIONAL_LIGHT && lights[lamp].falloff != FALLOFF_INVERSE_SQUARE);
}

void write_photon(uint photon, vec3 position, vec3 direction, vec3 power) {
    vec3 rows[3] = vec3[](position, direction, power);
    for (uint i = 0u; i < 9u; ++i)
        photon_words[9u * photon + i] = floatBitsToUint(rows[i / 3u][i % 3u]);
}

// Follows a photon through mirrors and glass to the next other surface.
void trace_photon(uvec2 position) {
    uint photon = (position.y + band.first_row) * PHOTONS_PER_ROW + position.x;
    if (photon >= frame.photon_count)
        return;
    uint number = frame.first_photon + photon;
    EmittedPhoton emitted = emit_photon(number);
    vec3 power = emitted.power;
    float travelled = 0.0;
    Ray ray = Ray(emitted.origin, emitted.direction, INFINITY, ALL_MASKS);
    for (uint bounce = 0u; bounce <= frame.max_depth && largest(power) > 0.0; ++bounce) {
        Hit hit = trace(ray, false, false);
        if (hit.object == NONE)
            break;
        Surface s = surface_at(ray, hit, true);
        travelled += s.distance;
        uint material = objects[hit.object].material;
        float choice = photon_pair(number, FIRST_BOUNCE_DIMENSION + bounce).x;
        bool is_glass = materials[material].model == GLASS, is_part = materials[material].transmission > 0.0;
        if (materials[material].model == METAL || is_part)
            add_material(s, hit, -ray.direction);
        float transmission = is_glass ? 1.0 : s.transmission;
        if (has_glass && choice < transmission) {
            vec2 uv = materials[material].roughness > 0.0 ? photon_pair(number, FIRST_FACET_DIMENSION + bounce) : vec2(0.0);
            GlassScatter glass =
                scatter_at_glass(s, ray.direction, material, uv, materials[material].roughness > 0.0);
            bool reflects = choice < glass.reflectance * transmission;
            power *= glass.transmittance * (reflects ? glass.reflection_tint * glass.unmasked_reflected
                                                     : glass.refraction_tint * glass.unmasked_refracted);
            ray.origin = reflects ? above(s) : below(s);
            ray.direction = normalize(reflects ? glass.reflected : glass.refracted);
            continue;
        }
        vec3 reflectance;
        float chance = mirror_chance_of(s, ray.direction, material, reflectance);
        if (choice < chance) {
            power *= reflectance * (1.0 / max(chance, 1e-6));
            ray.origin = above(s);
            ray.direction = normalize(reflected(s, ray.direction));
            continue;
        }
        if (bounce == 0u)
            break;
        if (emitted.grows)
            power *= travelled * travelled;
        write_photon(photon, s.position, ray.direction, power * (1.0 / max((1.0 - chance) * (1.0 - transmission), 1e-6)));
        return;
    }
    write_photon(photon, vec3(0.0), vec3(0.0), vec3(-1.0)); // it arrived nowhere
}
