// SPDX-License-Identifier: Apache-2.0
//
// Caustics: the light that photons bring to the surfaces on which they arrive. Equivalent to the second half of
// rt_embree's kernel/photons.inl.

layout(std430, set = 0, binding = 15) readonly buffer PhotonWords {
    uint photon_words[]; // nine floats for each photon, then the numbers and starts of the grids
};

// An estimate reads at most about this many photons, evenly spread over the cells. It needs far fewer, but one cell
// of the finest grid may hold almost all photons, if the others lie far away.
const float MOST_PHOTONS = 1024.0;
// The cells cover 16/π times the area of the density estimate: five times PhotonMap::photons_per_estimate.
const float ENOUGH_PHOTONS = 120.0;

vec3 photon_vector(uint photon, uint row) {
    uint first = 9u * photon + row;
    return uintBitsToFloat(uvec3(photon_words[first], photon_words[first + 1u], photon_words[first + 2u]));
}

// Returns the lowest of the cells around a surface point, of which there are two along each axis.
ivec3 lowest_cell(PhotonGrid grid, Surface s) {
    return ivec3(floor(clamp((s.position - frame.photon_low) * (0.5 / grid.radius), -2.0, 1e9) - 0.5));
}
ivec3 next_cell(ivec3 lowest, int i) {
    return lowest + ivec3(i & 1, i >> 1 & 1, i >> 2);
}

// Returns the range of the photons in the bucket of a cell.
uvec2 bucket_of(PhotonGrid grid, ivec3 cell) {
    uvec3 products = uvec3(cell) * uvec3(73856093u, 19349663u, 83492791u); // as PhotonGrid::hash of raytracer_common
    uint start = grid.first_start + ((products.x ^ products.y ^ products.z) & grid.bucket_mask);
    return uvec2(photon_words[start], photon_words[start + 1u]);
}

// The light of photons: what a virtual surface reflects to the eye; of a real surface, the irradiance, divided by π, and
// what its gloss mirrors to the eye.
struct PhotonLight {
    vec3 light, mirrored;
};

PhotonLight light_of_photon(vec3 power, bool is_real, Surface s, vec3 to_eye, vec3 to_light) {
    vec3 by_cosine = power * (1.0 / max(dot(s.normal, to_light), 0.01));
    if (!is_real)
        return PhotonLight((scattering(s, to_eye, to_light) + highlight(s, to_eye, to_light)) * by_cosine, vec3(0.0));
    return PhotonLight(power, has_gloss && s.is_rough ? gloss(s, to_eye, to_light) * by_cosine : vec3(0.0));
}

// `count`: number of photons in the buckets of the cells. `phase`: 0 to 1, chooses which photons are read if there are
// too many.
PhotonLight photon_density(PhotonGrid grid, uint count, bool is_real, Surface s, vec3 to_eye, float phase) {
    uint stride = uint(float(count) * (1.0 / MOST_PHOTONS)) + 1u, skipped = uint(phase * float(stride));
    float radius_squared = grid.radius * grid.radius, scale = 2.0 / (3.14159265 * radius_squared);
    ivec3 lowest = lowest_cell(grid, s);
    PhotonLight sum = PhotonLight(vec3(0.0), vec3(0.0));
    for (int i = 0; i < 8; ++i) {
        ivec3 cell = next_cell(lowest, i);
        uvec2 bucket = bucket_of(grid, cell);
        for (uint next = bucket.x + skipped; next < bucket.y; next += stride) {
            uint photon = photon_words[grid.first_number + next];
            vec3 position = photon_vector(photon, 0u), offset = position - s.position;
            float squared = dot(offset, offset), height = dot(offset, s.geometric_normal);
            vec3 to_light = -photon_vector(photon, 3u);
            // Cells share buckets, and photons of other surfaces near an edge do not count.
            if (ivec3((position - frame.photon_low) * (0.5 / grid.radius)) == cell && squared < radius_squared &&
                height * height < radius_squared * 0.09 && dot(to_light, s.geometric_normal) > 0.0) {
                vec3 power = photon_vector(photon, 6u) * (scale * (1.0 - squared / radius_squared));
                PhotonLight more = light_of_photon(power, is_real, s, to_eye, to_light);
                sum = PhotonLight(sum.light + more.light, sum.mirrored + more.mirrored);
            }
        }
    }
    return PhotonLight(sum.light * float(stride), sum.mirrored * float(stride));
}

// All samples of a pixel see the same photons, so only some of them make an estimate, for the others too.
PhotonLight photon_light(bool is_real, Surface s, vec3 to_eye, Random random) {
    PhotonLight none = PhotonLight(vec3(0.0), vec3(0.0));
    uint samples_per_estimate = frame.sample_count > 8u ? 4u : 1u;
    if (!has_photons || (random.number - frame.first_random) % samples_per_estimate != 0u)
        return none;
    uint estimates = (frame.sample_count + samples_per_estimate - 1u) / samples_per_estimate;
    // A random limit hides where the radius changes.
    vec2 choice = path_pair(random, PHOTON_DIMENSION, 0u, 1u);
    uint limit = uint(ENOUGH_PHOTONS * (1.0 + 3.0 * choice.x));
    for (uint level = 0u; level < frame.photon_level_count; ++level) {
        PhotonGrid grid = frame.photon_grids[level];
        ivec3 lowest = lowest_cell(grid, s);
        uint count = 0u;
        for (int i = 0; i < 8; ++i) {
            uvec2 bucket = bucket_of(grid, next_cell(lowest, i));
            count += bucket.y - bucket.x;
        }
        if (count == 0u)
            break;
        if (count <= limit || level + 1u == frame.photon_level_count) {
            PhotonLight found = photon_density(grid, count, is_real, s, to_eye, choice.y);
            float scale = float(frame.sample_count) / float(estimates);
            return PhotonLight(found.light * scale, found.mirrored * scale);
        }
    }
    return none;
}
