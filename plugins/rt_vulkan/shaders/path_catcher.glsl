// SPDX-License-Identifier: Apache-2.0
//
// Real surfaces: how virtual objects change the light of catchers, and what the video shows of them. Equivalent to
// rt_embree's kernel/path_catcher.inl.

// Bits of frame.shown_parts.
const uint SHADOW_PART = 1u, BOUNCE_PART = 2u, CAUSTICS_PART = 4u;

// Returns whether an image shows a part of the change of a catcher's light.
bool shows(uint part) {
    return !may_denoise || (frame.shown_parts & part) != 0u;
}

// Returns whether a ray can meet a virtual object. `end`: in lengths of `to`.
bool can_meet_virtual(vec3 origin, vec3 to, float end) {
    float scale = 1.0 / max(dot(to, to), 1e-30);
    for (uint i = 0u; i < frame.sphere_count; ++i) {
        vec3 to_centre = frame.spheres[i].xyz - origin;
        vec3 miss = to_centre - to * clamp(dot(to_centre, to) * scale, 0.0, min(end, 1e18));
        if (dot(miss, miss) < frame.spheres[i].w * frame.spheres[i].w)
            return true;
    }
    return false;
}

// The directions in which a catcher may see a virtual object are sampled by the bounding spheres: uniformly in the
// cone of a sphere, or in the whole hemisphere if the sphere is close.
struct SphereCone {
    vec3 axis;    // unit vector to the centre
    float share;  // about the form factor of the sphere, an upper bound
    float cosine; // of the half angle; valid unless `is_wide`
    float slope;  // 1 − cosine
    bool is_wide;
};
SphereCone cone_of(vec4 sphere, Surface s) {
    vec3 to_centre = sphere.xyz - s.position;
    float squared = max(dot(to_centre, to_centre), 1e-20), sine_squared = min(sphere.w * sphere.w / squared, 1.0);
    vec3 axis = to_centre * (1.0 / sqrt(squared));
    float height = clamp(dot(axis, s.normal) + sqrt(sine_squared), 0.0, 1.0);
    return SphereCone(axis, sine_squared * height, sqrt(max(1.0 - sine_squared, 0.0)), slope_of_cone(sine_squared),
                      sine_squared > 0.5);
}

// The sum of the spheres' shares.
float form_factors_of(Surface s) {
    float total = 0.0;
    for (uint i = 0u; i < frame.sphere_count; ++i)
        total += cone_of(frame.spheres[i], s).share;
    return total;
}

// Chance of a ray from a catcher towards the virtual objects. There is none where the sum of the form factors is below
// 1/512, so that objects do not affect the whole desk.
float bounce_chance(float form_factors) {
    return form_factors < 1.0 / 512.0 ? 0.0 : clamp(form_factors * 3.0, 0.02, 1.0);
}

// Density per steradian of the rays from a catcher towards the virtual objects.
float bounce_density(Surface s, vec3 direction, float form_factors) {
    float density = 0.0, by_cosine = max(dot(direction, s.normal), 0.0) * 0.318309886;
    for (uint i = 0u; i < frame.sphere_count; ++i) {
        SphereCone cone = cone_of(frame.spheres[i], s);
        if (cone.is_wide)
            density += cone.share * by_cosine;
        else if (dot(direction, cone.axis) >= cone.cosine)
            density += cone.share * density_in_cone(cone.slope);
    }
    return density / max(form_factors, 1e-20) * bounce_chance(form_factors);
}

// Pushes a ray from a real surface towards the virtual objects. `throughput`: of its irradiance, divided by π.
void push_bounce(Path path, Surface s, float form_factors, vec3 throughput, Random random) {
    vec2 choice = path_pair(random, CHOICE_DIMENSION, 0u, 1u), uv = path_pair(random, SCATTER_DIMENSION, 0u, 1u);
    if (!(choice.x < bounce_chance(form_factors)))
        return;
    vec3 direction = cosine_direction(s.normal, uv.x, uv.y);
    float remaining = choice.y * form_factors;
    for (uint i = 0u; i < frame.sphere_count; ++i) {
        SphereCone cone = cone_of(frame.spheres[i], s);
        if (remaining < cone.share) {
            if (!cone.is_wide)
                direction = cone_direction(cone.axis, cone.slope, uv.x, uv.y);
            break;
        }
        remaining -= cone.share;
    }
    float density = bounce_density(s, direction, form_factors), cosine = dot(direction, s.normal);
    float sample_ratio = 1.0; // of the surface's light samples to those of a surface of this depth
    if (path.depth > 0u) { // not a catcher, but a surface that the video shows
        path.plane |= FILMED_BIT;
        sample_ratio = float(source_samples(path.depth - 1u)) / float(source_samples(path.depth));
    }
    if (density > 0.0 && cosine > 0.0 && dot(direction, s.geometric_normal) > 0.0)
        push(path, above(s), direction, throughput * (cosine * 0.318309886 / max(density, 1e-20)),
             sample_ratio / max(density, 1e-30));
}

// The light of the current sample in MIRRORED_PLANE and COVERED_PLANE, and that of Sums.matt.
vec3 mirrored, covered, matt;

// Returns the share of a real surface's light that virtual objects can shadow: 1 for dielectrics, unless they are black.
// Metals only mirror.
float shadowed_share(Surface s) {
    const float dielectric_reflectance = 0.04;
    float diffuse = luminance(s.diffuse);
    return diffuse / (diffuse + max(luminance(s.specular) - dielectric_reflectance, 1e-6));
}

// Returns whether the gloss mirrors about 1/256 of the virtual objects' radiance or more: the reflectance, times the
// share of the reflected rays that meet the bounding spheres, if all were as dense as the densest.
bool mirrors_virtual(Surface s, vec3 to_eye) {
    vec3 middle = mirror_direction(-to_eye, s.normal);
    float share = 0.0;
    for (uint i = 0u; i < frame.sphere_count; ++i) {
        SphereCone cone = cone_of(frame.spheres[i], s);
        float along = dot(middle, cone.axis);
        vec3 densest = middle; // direction in the cone
        if (!cone.is_wide && along < cone.cosine) {
            vec3 across = middle - cone.axis * along;
            float sine = sqrt(max(1.0 - cone.cosine * cone.cosine, 0.0));
            densest = cone.axis * cone.cosine + across * (sine / max(length(across), 1e-6));
        }
        float density = ggx_reflection_density(dot(s.normal, to_eye), dot(s.normal, normalize(densest + to_eye)), s.alpha);
        share += min(density * cone.slope * 6.28318531, 1.0);
    }
    return largest(fresnel_of(s, dot(s.normal, to_eye))) * share >= 1.0 / 256.0;
}

// Pushes a ray that the gloss of a catcher reflects, if it can meet a virtual object.
void push_mirrored(Path path, Surface s, vec3 to_eye, Random random) {
    path.plane = MIRRORED_PLANE;
    random.pixel += (MIRRORED_PLANE - CHANGE_PLANE) * TILE_PIXELS;
    int before = stack_size;
    scatter_rough(path, s, to_eye, path_pair(random, SCATTER_DIMENSION, 0u, 1u));
    if (stack_size > before && !can_meet_virtual(s.position, stack[before].direction, INFINITY))
        stack_size = before;
}

// Finds the light of the video in a direction from the camera's eye, which may have any length. Returns false if the
// video does not show it.
bool filmed_towards(vec3 to_point, out vec3 light) {
    vec3 p = to_point * frame.world_from_camera; // the inverse of a rotation matrix is its transpose
    light = vec3(0.0);
    vec3 at = vec3(p.xy / max(p.z, 1e-6), 1.0);
    if (!(p.z > 1e-6) || !(dot(at.xy, at.xy) < frame.max_radius_squared))
        return false;
    vec4 a = frame.lens[0], b = frame.lens[1], c = frame.lens[2];
    if (frame.distortion == BROWN_DISTORTION)
        at = brown_conrady(BrownConrady(a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w, c.x, c.y, c.z, c.w), at);
    else if (frame.distortion == FISHEYE_DISTORTION)
        at = kannala_brandt(KannalaBrandt(a.x, a.y, a.z, a.w), at);
    // Pixel centres are at integers, texel centres at halves.
    vec2 pixel = at.xy * frame.focal_length + frame.principal_point + 0.5, size = vec2(frame.width, frame.height);
    if (!all(greaterThan(pixel, vec2(0.0))) || !all(lessThan(pixel, size)))
        return false;
    light = sample_level(frame.video_texture, 0, pixel / size).rgb;
    return true;
}
