// SPDX-License-Identifier: Apache-2.0
//
// Caustics: photons that lamps send onto mirrors and glass, and the light that these photons bring to the surfaces on
// which they arrive. Paths from the eye do not find small lamps off mirrors and through glass.
#pragma once
#include "path_lights.inl"

using arhost::raytracer_common::Photon, arhost::raytracer_common::PhotonMap;

// As PhotonGrid::hash of raytracer_common.
ARHOST_INLINE Int photon_hash(Int x, Int y, Int z) {
    return (x * Int(73856093)) ^ (y * Int(19349663)) ^ (z * Int(83492791));
}

enum PhotonDimension : int {
    target_dimension = 128,
    origin_dimension,
    aim_dimension,
    first_bounce_dimension,     // one dimension for each bounce, of at most 100
    first_facet_dimension = 256 // likewise
};

// Returns the random numbers of a dimension of the photons with these numbers.
ARHOST_INLINE Pair photon_pair(Int number, int dimension) {
    const PairBits<Int> bits = owen_pair(number, hash(Int(dimension)));
    return pair_of(bits.u, bits.v);
}

// Light that leaves a lamp towards a mirror or glass.
struct EmittedPhotons {
    Vec3 origin, direction, power;
    Bool active;
    Bool grows; // lamps without falloff: the power is to be multiplied by the square of the distance travelled
};

ARHOST_INLINE EmittedPhotons emit_photons(const Frame &frame, Int number, Bool active) {
    const PathScene &path = frame.path;
    const Caustics &caustics = path.caustics;
    const Pair target = photon_pair(number, target_dimension);
    const Int pair = search(caustics.cumulative, Int(0), caustics.sphere_count * caustics.lamp_count, target.u);
    const Int lamp =
        to_int(floor((to_float(pair) + Float(0.5f)) * Float(1.0f / static_cast<float>(caustics.sphere_count))));
    const Int first_pair = lamp * Int(caustics.sphere_count), first = lamp * Int(source_rows);
    const auto field = [&](int row) __attribute__((always_inline)) {
        return gather(path.sources + row, first);
    };
    const auto vector = [&](int row) __attribute__((always_inline)) {
        return Vec3{field(row), field(row + 1), field(row + 2)};
    };
    const auto sphere_at = [&](Int i, int row) __attribute__((always_inline)) {
        return gather(caustics.spheres + row, i << Int(2));
    };
    const Int chosen = pair - first_pair;
    const Vec3 centre{sphere_at(chosen, 0), sphere_at(chosen, 1), sphere_at(chosen, 2)};
    const Float sphere_radius = sphere_at(chosen, 3);
    const Int type = to_int(field(type_row));
    const Bool directional = type == Int(ARHOST_LIGHT_DIRECTIONAL), rectangle = type == Int(ARHOST_LIGHT_RECTANGLE),
               spot = type == Int(ARHOST_LIGHT_SPOT);
    const Vec3 lamp_direction = vector(direction_row), position = vector(position_row);
    const Pair uv = photon_pair(number, origin_dimension), aim = photon_pair(number, aim_dimension);

    // The point of the lamp, and the cone from there to the sphere. From its centre, any axis is right.
    const auto axis = [](Vec3 to) __attribute__((always_inline)) {
        return select(dot(to, to) > Float(1e-12f), to, Vec3{Float(0.0f), Float(0.0f), Float(1e-6f)});
    };
    const Float radius = field(radius_row);
    Vec3 origin = position;
    if (any(radius > Float(0.0f)))
        origin = select(radius > Float(0.0f), centre + vector_to_disc(axis(position - centre), radius, uv.u, uv.v),
                        origin);
    if (any(rectangle))
        origin = select(rectangle, vector_to_rectangle(position, vector(axis_u_row), vector(axis_v_row), uv.u, uv.v),
                        origin);
    const auto slope_of = [](Float sphere, Float squared) __attribute__((always_inline)) {
        const Float sine_squared = min(sphere * sphere / max(squared, Float(1e-20f)), Float(1.0f));
        // From inside the sphere, all directions.
        return select(sine_squared < Float(1.0f),
                      sine_squared / (Float(1.0f) + sqrt(max(Float(1.0f) - sine_squared, Float(0.0f)))), Float(2.0f));
    };
    const Vec3 to_centre = centre - origin;
    const Float squared = dot(to_centre, to_centre);
    Vec3 direction = cone_direction(normalize(axis(to_centre)), slope_of(sphere_radius, squared), aim.u, aim.v);
    if (any(directional)) { // parallel light, from a disc outside of the scene
        const Vec3 disc = vector_to_disc(-lamp_direction, sphere_radius, aim.u, aim.v) + lamp_direction;
        origin = select(directional, centre + disc - lamp_direction * Float(caustics.scene_extent), origin);
        direction = select(directional, lamp_direction, direction);
    }
    // The density of the photons of this lamp in the direction, per steradian, or of parallel light, per area.
    Float density(0.0f);
    for (std::int32_t i = 0; i < caustics.sphere_count; ++i) {
        const float *sphere = caustics.spheres + 4 * i;
        const Vec3 to_sphere = splat(sphere) - origin;
        const Float chance = gather(caustics.chances + i, first_pair);
        const Float slope = slope_of(Float(sphere[3]), dot(to_sphere, to_sphere));
        const Float along = dot(to_sphere, direction);
        const Vec3 across = to_sphere - direction * along;
        // The sphere that was aimed at counts in spite of rounding errors.
        const Bool in_beam = (dot(across, across) < Float(sphere[3] * sphere[3])) | (chosen == Int(i));
        const Bool in_cone = in_beam & ((along > Float(0.0f)) | (slope > Float(1.0f)));
        const Float of_cone = Float(0.159154943f) / slope, of_beam(0.318309886f / (sphere[3] * sphere[3]));
        density = density + chance * select(directional, select(in_beam, of_beam, Float(0.0f)),
                                            select(in_cone, of_cone, Float(0.0f)));
    }
    Float share = Float(1.0f) / max(density * Float(static_cast<float>(caustics.photon_count)), Float(1e-30f));
    if (any(spot))
        share = select(spot,
                       share * spot_attenuation(dot(lamp_direction, direction), field(cosine_inner_row),
                                                field(cosine_outer_row)),
                       share);
    if (any(rectangle))
        share = select(rectangle, share * lambert(lamp_direction, direction), share);
    return {origin, direction, vector(intensity_row) * share,
            active & (share > Float(0.0f)) & (density > Float(0.0f)),
            (field(falloff_row) < Float(0.5f)) & ~directional};
}

// See TracePhotons.
ARHOST_INLINE Int face_of(Vec3 normal) {
    // Slopes of exactly 45° keep clear of the limits.
    const Float x = abs(normal.x), y = abs(normal.y) * Float(1.01f), z = abs(normal.z) * Float(1.02f);
    const auto side = [](Float a, int axis) __attribute__((always_inline)) {
        return select(a > Float(0.0f), Int(2 * axis + 1), Int(2 * axis));
    };
    const Int across = select(x > y, side(normal.x, 0), side(normal.y, 1));
    return select((z >= x) & (z >= y), side(normal.z, 2), across);
}

// Follows photons through mirrors and glass. Returns those that then arrive at another surface.
ARHOST_INLINE void trace_photon_packet(const Frame &frame, std::uint32_t first, Photon *to, std::int8_t *faces,
                                       Bool active) {
    const Scene &scene = frame.scene;
    const Int number = lane_numbers() + Int(static_cast<int>(first + frame.path.caustics.first_number));
    const EmittedPhotons emitted = emit_photons(frame, number, active);
    Vec3 origin = emitted.origin, direction = emitted.direction, power = emitted.power;
    Bool flying = emitted.active, arrived = bool_of(false);
    Vec3 position = black(), arriving = black();
    Int face(virtual_face);
    Float travelled(0.0f);
    for (std::uint32_t bounce = 0; bounce <= scene.max_depth && any(flying); ++bounce) {
        RTCRayHit16 rays;
        set_ray(rays.ray, origin, direction, Float(far_away), Int(all_masks));
        flying = trace(scene, scene.root, make_query(Coherence::incoherent), rays, flying);
        if (!any(flying))
            break;
        const Surface s = surface_at(scene, rays, flying);
        travelled = travelled + select(flying, s.distance, Float(0.0f));
        const Float choice = photon_pair(number, first_bounce_dimension + static_cast<int>(bounce)).u;
        Bool specular = bool_of(false);
        Vec3 next_origin = origin, next_direction = direction;
        for_each_object(scene, rays.hit, flying, [&](const Object &object, Bool here) {
            const arhost_material &material = *object.material;
            const Vec3 above = s.position + s.geometric_normal * s.offset;
            if (material.model == ARHOST_MATERIAL_MIRROR || material.model == ARHOST_MATERIAL_METAL) {
                Vec3 reflectance = splat(material.reflectivity);
                Float chance(1.0f);
                if (material.model == ARHOST_MATERIAL_METAL) {
                    reflectance = schlick(reflectance, -dot(direction, s.normal));
                    chance = metal_mirror_chance(reflectance, s.diffuse);
                }
                const Bool mirrored = here & (choice < chance);
                power = select(mirrored, power * reflectance * (Float(1.0f) / max(chance, Float(1e-6f))),
                               select(here, power * (Float(1.0f) / max(Float(1.0f) - chance, Float(1e-6f))), power));
                next_origin = select(mirrored, above, next_origin);
                next_direction = select(mirrored, reflected(s, direction), next_direction);
                specular = specular | mirrored;
            } else if (material.model == ARHOST_MATERIAL_GLASS || material.transmission > 0) {
                const Float share =
                    select(bool_of(material.model == ARHOST_MATERIAL_GLASS), Float(1.0f), s.transmission);
                const Bool transmits = here & (choice < share);
                const Pair uv = material.roughness > 0
                                    ? photon_pair(number, first_facet_dimension + static_cast<int>(bounce))
                                    : Pair{};
                const Glass glass = glass_of(material, s);
                const GlassScatter scatter = scatter_at_glass(s, direction, glass, uv, transmits);
                const Bool reflects = transmits & (choice < scatter.reflectance * share);
                power = select(transmits,
                               power * scatter.transmittance *
                                   select(reflects, glass.reflection * scatter.unmasked_reflected,
                                          glass.refraction * scatter.unmasked_refracted),
                               select(here, power * (Float(1.0f) / max(Float(1.0f) - share, Float(1e-6f))), power));
                next_origin = select(transmits, select(reflects, above, s.position - s.geometric_normal * s.offset),
                                     next_origin);
                next_direction =
                    select(transmits, select(reflects, scatter.reflected, scatter.refracted), next_direction);
                specular = specular | transmits;
            }
        });
        if (bounce > 0) {
            const Bool ends = flying & ~specular & s.is_lit;
            position = select(ends, s.position, position);
            arriving = select(ends, direction, arriving);
            const Vec3 towards_photon =
                select(dot(s.geometric_normal, direction) > Float(0.0f), -s.geometric_normal, s.geometric_normal);
            face = select(ends & s.is_real, face_of(towards_photon), face);
            arrived = arrived | ends;
        }
        flying = flying & specular & (largest(power) > Float(0.0f));
        origin = next_origin;
        direction = normalize(next_direction);
    }
    power = select(emitted.grows & arrived, power * (travelled * travelled), power);
    alignas(64) float rows[9][lanes];
    const Float values[] = {position.x,
                            position.y,
                            position.z,
                            arriving.x,
                            arriving.y,
                            arriving.z,
                            select(arrived, power.x, Float(-1.0f)),
                            power.y,
                            power.z};
    for (int row = 0; row < 9; ++row)
        store(rows[row], values[row]);
    alignas(64) int face_by_lane[lanes];
    store(face_by_lane, face);
    for (unsigned remaining = mask_of(active.lane); remaining; remaining &= remaining - 1) {
        const int i = __builtin_ctz(remaining);
        auto *numbers = reinterpret_cast<float *>(to + i);
        for (int row = 0; row < 9; ++row)
            numbers[row] = rows[row][i];
        faces[i] = static_cast<std::int8_t>(face_by_lane[i]);
    }
}

// Returns the cell of a grid that contains a point. `at`: in cells, from the corner of all grids.
ARHOST_INLINE Int photon_cell(Float at) {
    return to_int(floor(min(max(at, Float(-2.0f)), Float(1e9f))));
}

// Returns the lanes in which photons may be within `reach` mm of a point, and at least within a cell of the coarsest
// grid.
ARHOST_INLINE Bool is_near_photons(const Photons &photons, Vec3 position, Float reach) {
    Float side(2 * photons.levels[0].radius);
    Int level(0);
    for (int i = 1; i < PhotonMap::near_levels; ++i) {
        const Bool wider = side < reach;
        level = select(wider, Int(i), level);
        side = select(wider, side * Float(2.0f), side);
    }
    const Vec3 at = (position - splat(photons.low)) * (Float(1.0f) / side);
    const Int bit =
        photon_hash(photon_cell(at.x), photon_cell(at.y), photon_cell(at.z)) & Int(PhotonMap::near_bits - 1);
    const Int word = gather(photons.near, level * Int(PhotonMap::near_bits / 32) + shift_right_unsigned(bit, 5));
    return (((word >> (bit & Int(31))) & Int(1)) == Int(1)) | (side < reach);
}

// The cells of a grid around surface points: two along each axis.
struct NearCells {
    Int cell[8][3], first[8], end[8]; // the photons of the cell's bucket
    Int count;                        // photons in all of these buckets
};
ARHOST_INLINE NearCells cells_near(const Photons &photons, const PhotonGrid &grid, const Surface &s) {
    const Float inverse_cell(0.5f / grid.radius);
    const Vec3 at = (s.position - splat(photons.low)) * inverse_cell;
    const auto lower = [](Float a) __attribute__((always_inline)) {
        return to_int(floor(min(max(a, Float(-2.0f)), Float(1e9f)) - Float(0.5f)));
    };
    const Int low[3] = {lower(at.x), lower(at.y), lower(at.z)};
    NearCells cells;
    cells.count = Int(0);
    for (int i = 0; i < 8; ++i) {
        Int *cell = cells.cell[i];
        cell[0] = low[0] + Int(i & 1);
        cell[1] = low[1] + Int(i >> 1 & 1);
        cell[2] = low[2] + Int(i >> 2);
        const Int bucket = photon_hash(cell[0], cell[1], cell[2]) & Int(grid.bucket_mask);
        cells.first[i] = gather(grid.starts, bucket);
        cells.end[i] = gather(grid.starts + 1, bucket);
        cells.count = cells.count + cells.end[i] - cells.first[i];
    }
    return cells;
}

// An estimate reads at most about this many photons, evenly spread over the cells. It needs far fewer, but one cell
// of the finest grid may hold almost all photons, if the others lie far away.
constexpr float most_photons = 1024;

// The light of photons: what a surface reflects, or the irradiance of a real surface, divided by π; and what the
// gloss of a real surface mirrors to the eye.
struct PhotonLight {
    Vec3 light, mirrored;
};

// Returns the area in which a plane meets a cell, in units of a cell's side. `from_centre`: from the centre of the
// cell to a point of the plane. It is the derivative of the volume on one side, which is the sum over the corners of
// signed cubes of their distances. A small area counts as a quarter, since surfaces may be curved.
ARHOST_INLINE Float area_in_cell(Vec3 normal, Vec3 from_centre) {
    const auto component = [](Float a) __attribute__((always_inline)) {
        return max(abs(a), Float(0.005f));
    };
    const Vec3 n = normalize(Vec3{component(normal.x), component(normal.y), component(normal.z)});
    const Float height = abs(dot(from_centre, normal));
    Float sum(0.0f);
    for (int corner = 0; corner < 8; ++corner) {
        const auto half = [&](Float a, int axis) __attribute__((always_inline)) {
            return corner >> axis & 1 ? a * Float(0.5f) : a * Float(-0.5f);
        };
        const Float along = max(height + half(n.x, 0) + half(n.y, 1) + half(n.z, 2), Float(0.0f));
        sum = __builtin_popcount(static_cast<unsigned>(corner)) & 1 ? sum + along * along : sum - along * along;
    }
    return max(sum / (n.x * n.y * n.z * Float(2.0f)), Float(0.25f));
}

// As photon_density(), but from the sums of the cells at random points nearby: on average over frames and
// neighbouring pixels, there are no steps between cells.
template <class LightOf>
ARHOST_INLINE PhotonLight summed_photons(const Photons &photons, const Surface &s, Pair random, Bool active,
                                         LightOf light_of) {
    const Int face = select(s.is_real, face_of(s.geometric_normal), Int(virtual_face));
    const float *cells = photons.cells;
    Vec3 irradiance = black(), to_light = s.geometric_normal;
    // A cell with more photons is replaced by smaller ones. A random limit hides where their size changes.
    const auto low_bits = [](Float a) __attribute__((always_inline)) {
        return a * Float(256.0f) - floor(a * Float(256.0f));
    };
    const Int limit = to_int(Float(static_cast<float>(PhotonCell::least_limit)) + low_bits(random.v) * Float(8.0f));
    const Float third = low_bits(random.u);
    for (std::int32_t level = 0; level < photons.level_count && any(active); ++level) {
        const float side = 2 * photons.levels[level].radius;
        const Vec3 any_offset = Vec3{random.u - Float(0.5f), random.v - Float(0.5f), third - Float(0.5f)} * side;
        const Vec3 offset = any_offset - s.geometric_normal * dot(any_offset, s.geometric_normal);
        const Vec3 at = (s.position + offset - splat(photons.low)) * Float(1 / side);
        const Int x = photon_cell(at.x), y = photon_cell(at.y), z = photon_cell(at.z);
        // As PhotonCell::key_of and hash.
        const Int key = x * Int(static_cast<int>(2654435761u)) + y * Int(static_cast<int>(2246822519u)) +
                        z * Int(static_cast<int>(3266489917u)) + (Int(8 * level) + face) * Int(668265263);
        Int slot = (key ^ shift_right_unsigned(key, 15)) & Int(photons.cell_mask), count(0);
        Vec3 power = black(), towards = black();
        for (Bool searching = active; any(searching);) {
            const Int here = select(searching, slot * Int(PhotonCell::floats), Int(0));
            const auto vector = [&](int row) __attribute__((always_inline)) {
                return Vec3{gather(cells + row, here), gather(cells + row + 1, here), gather(cells + row + 2, here)};
            };
            const Int number = bits_of(gather(cells + 6, here));
            const Bool found = searching & (Int(0) < number) & (bits_of(gather(cells + 7, here)) == key);
            if (any(found)) {
                count = select(found, number, count);
                power = select(found, vector(0), power);
                towards = select(found, -vector(3), towards);
            }
            searching = searching & ~found & (Int(0) < number);
            slot = (slot + Int(1)) & Int(photons.cell_mask);
        }
        // At the finest level a cell may hold all photons.
        const Bool dense = active & (limit < count) & bool_of(level + 1 < photons.level_count);
        const Bool here = active & ~dense & (Int(0) < count);
        if (any(here)) {
            const auto from_centre = [](Float a) __attribute__((always_inline)) {
                return a - floor(a) - Float(0.5f);
            };
            const Float area =
                area_in_cell(s.geometric_normal, {from_centre(at.x), from_centre(at.y), from_centre(at.z)});
            irradiance = select(here, power * (Float(1 / (side * side)) / area), irradiance);
        }
        to_light = select(here, towards, to_light);
        active = dense;
    }
    to_light = normalize(to_light);
    const Bool counts = (largest(irradiance) > Float(0.0f)) & (dot(to_light, s.geometric_normal) > Float(0.0f));
    if (!any(counts))
        return {black(), black()};
    const PhotonLight light = light_of(irradiance, to_light);
    return {select(counts, light.light, black()), select(counts, light.mirrored, black())};
}

// `phase`: 0 to 1, chooses which photons are read if there are too many.
template <class LightOf>
ARHOST_INLINE PhotonLight photon_density(const Photons &photons, const PhotonGrid &grid, const NearCells &cells,
                                         const Surface &s, Float phase, Bool active, LightOf light_of) {
    const Int step = to_int(to_float(cells.count) * Float(1 / most_photons)) + Int(1),
              skipped = to_int(phase * to_float(step));
    const Float radius_squared(grid.radius * grid.radius), scale(2 / (3.14159265f * grid.radius * grid.radius));
    const Float inverse_cell(0.5f / grid.radius);
    PhotonLight sum{black(), black()};
    for (int i = 0; i < 8; ++i)
        for (Int next = cells.first[i] + skipped;; next = next + step) {
            const Bool here = active & (next < cells.end[i]);
            if (!any(here))
                break;
            const Int photon = gather(grid.numbers, select(here, next, Int(0))) * Int(9);
            const auto value = [&](int row) __attribute__((always_inline)) {
                return gather(photons.photons + row, photon);
            };
            const Vec3 position{value(0), value(1), value(2)}, offset = position - s.position;
            const Vec3 at = (position - splat(photons.low)) * inverse_cell;
            const Bool of_cell = (to_int(at.x) == cells.cell[i][0]) & (to_int(at.y) == cells.cell[i][1]) &
                                 (to_int(at.z) == cells.cell[i][2]);
            const Float squared = dot(offset, offset), height = dot(offset, s.geometric_normal);
            // Photons of other surfaces near an edge do not count.
            const Bool near =
                here & of_cell & (squared < radius_squared) & (height * height < radius_squared * Float(0.09f));
            if (!any(near))
                continue;
            const Vec3 to_light = -Vec3{value(3), value(4), value(5)};
            const Bool counts = near & (dot(to_light, s.geometric_normal) > Float(0.0f));
            const Float kernel = scale * (Float(1.0f) - squared * (Float(1.0f) / radius_squared));
            const PhotonLight light = light_of(Vec3{value(6), value(7), value(8)} * kernel, to_light);
            sum.light = sum.light + select(counts, light.light, black());
            sum.mirrored = sum.mirrored + select(counts, light.mirrored, black());
        }
    return {sum.light * to_float(step), sum.mirrored * to_float(step)};
}

// Returns the light that photons bring to the surfaces: the sum of light_of(irradiance / π, direction to the light).
// All samples of a pixel see the same photons, so only some of them make an estimate, for the others too.
template <class LightOf>
ARHOST_INLINE PhotonLight photon_light(const Work &work, const Paths &paths, const Surface &s, Bool active,
                                       LightOf light_of) {
    const Photons &photons = work.frame.path.photons;
    PhotonLight sum{black(), black()};
    if (photons.level_count == 0)
        return sum;
    active = active & is_near_photons(photons, s.position, Float(0.0f));
    if (!any(active))
        return sum;
    if (photons.cells)
        return summed_photons(photons, s, path_pair(work, paths, photon_dimension), active, light_of);
    const std::int32_t step = work.frame.sample_count > 8 ? 4 : 1;
    if (work.index % static_cast<std::uint32_t>(step) != 0)
        return sum;
    const std::int32_t estimates = (work.frame.sample_count + step - 1) / step;
    const Pair random = path_pair(work, paths, photon_dimension);
    // The cells cover 16/π times the area of the density estimate. A random limit hides where the radius changes.
    constexpr float enough = 5 * static_cast<float>(arhost::raytracer_common::PhotonMap::photons_per_estimate);
    const Int limit = to_int(Float(enough) * (Float(1.0f) + Float(3.0f) * random.u));
    for (std::int32_t level = 0; level < photons.level_count && any(active); ++level) {
        const PhotonGrid &grid = photons.levels[level];
        const NearCells cells = cells_near(photons, grid, s);
        active = active & (Int(0) < cells.count);
        const Bool dense = active & (limit < cells.count) & bool_of(level + 1 < photons.level_count);
        const Bool here = active & ~dense;
        if (any(here)) {
            const PhotonLight more = photon_density(photons, grid, cells, s, random.v, here, light_of);
            sum = {sum.light + more.light, sum.mirrored + more.mirrored};
        }
        active = dense;
    }
    const Float scale(static_cast<float>(work.frame.sample_count) / static_cast<float>(estimates));
    return {sum.light * scale, sum.mirrored * scale};
}
