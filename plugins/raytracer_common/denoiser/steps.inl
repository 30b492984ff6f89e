// SPDX-License-Identifier: Apache-2.0
//
// The denoiser: means over frames along the motion of surfaces, then a filter that is wider where the means are less
// certain (C. Schied et al., Spatiotemporal Variance-Guided Filtering, HPG 2017). It denoises the light of the
// surface at the centre of each pixel: of virtual objects, their radiance divided by their albedo; of catchers, the
// change of their light. At edges, more rays find which surfaces a pixel shows, and the pixel gets the light of the
// neighbours that show them. The ray tracers write the light, the guides and the rays at edges.
//
// base.cpp, avx2.cpp and avx512.cpp each define ARHOST_ISA and include this file.
#include "raytracer_common/denoiser/steps.hpp"

#include "raytracer_common/packets/packet.hpp"

namespace arhost::raytracer_common::ARHOST_ISA {
namespace {

// Included inside the namespace so that each instruction set has its own copy of the functions.
#include "raytracer_common/denoiser/history.inl"
#include "raytracer_common/packets/image.inl"

// The means of earlier frames at surfaces.
struct Past {
    Vec3 light, seen;         // seen: see seen_history
    Float moments[2], frames; // frames: 0 if the surface is new
};
// `x`, `row`: of the first cell.
ARHOST_INLINE Past past_of(const Denoising &denoising, const Layer &layer, int x, int row, Vec3 position, Vec3 normal,
                           Int surface, Bool active) {
    Past past{black(), black(), {Float(0.0f), Float(0.0f)}, Float(0.0f)};
    if (!layer.before[0])
        return past;
    // The point may be in any pixel of its cell. The cell moves as that point does.
    Projected now{};
    if (layer.cell_px > 1)
        now = projected(denoising, denoising.camera, position);
    const PastPoints before = points_before(denoising, position, normal, surface, active);
    Projected at = projected(denoising, denoising.camera_before, before.position);
    if (layer.cell_px > 1) {
        const Float per_pixel(1.0f / static_cast<float>(layer.cell_px));
        at.x = to_float(lane_numbers() + Int(x)) + (at.x - now.x) * per_pixel;
        at.y = Float(static_cast<float>(row)) + (at.y - now.y) * per_pixel;
    }
    Float total(0.0f);
    const bool needs_seen =
        layer.keeps_seen && !denoising.seen_moves() && any(active & is_kind(surface, specular_surface));
    for_each_past_cell(
        layer, at.x, at.y, at.distance, before.normal, surface,
        active & at.inside, [&](Int cell, Float share, Bool here) __attribute__((always_inline)) {
            const auto add = [&](Float & sum, int of) __attribute__((always_inline)) {
                sum = sum + select(here, gather(layer.before[of], cell), Float(0.0f)) * share;
            };
            add(past.light.x, 0);
            add(past.light.y, 1);
            add(past.light.z, 2);
            add(past.moments[0], moment_history);
            add(past.moments[1], moment_history + 1);
            add(past.frames, frames_history);
            total = total + share;
            if (!needs_seen)
                return;
            add(past.seen.x, seen_history);
            add(past.seen.y, seen_history + 1);
            add(past.seen.z, seen_history + 2);
        });
    const Float scale = select(total > Float(0.0f), Float(1.0f) / max(total, Float(1e-6f)), Float(0.0f));
    past.light = past.light * scale;
    past.seen = past.seen * scale;
    for (Float &moment : past.moments)
        moment = moment * scale;
    past.frames = past.frames * scale;
    return past;
}

// Returns the light of a row's cells without fireflies: single paths that find a small bright light would remain
// visible for many frames. So light may be only somewhat brighter than that of the cells around, if there are enough
// of the same surface.
ARHOST_INLINE Vec3 light_without_fireflies(const Layer &layer, std::ptrdiff_t at, int row, Int surface) {
    // The nearest cells that were sampled, too.
    const int apart = layer.takes_turns ? 2 : 1;
    const auto brightness_of = [&](Vec3 light) __attribute__((always_inline)) { // gloss may be negative
        const Float value = luminance(light);
        return layer.holds == LayerLight::gloss ? abs(value) : value;
    };
    Float brightest(0.0f), count(0.0f);
    for (int dy = -apart; dy <= apart; dy += apart)
        for (int dx = -apart; dx <= apart; dx += apart) {
            if ((dx == 0 && dy == 0) || row + dy < 0 || row + dy >= layer.height)
                continue;
            const std::ptrdiff_t there = at + dy * layer.guide_stride() + dx;
            const Bool same = (surfaces_at(layer, there) == surface) &
                              (load(layer.light[0][variance_light] + there) == Float(sampled));
            brightest = max(brightest, select(same, brightness_of(load3(layer.light[0], there)), Float(0.0f)));
            count = count + select(same, Float(1.0f), Float(0.0f));
        }
    const Float limit = select(count < Float(3.0f), Float(far_away), brightest * Float(4.0f) + Float(0.1f));
    const Vec3 light = load3(layer.light[0], at);
    const Float value = brightness_of(light);
    return light * select(value > limit, limit / max(value, Float(1e-6f)), Float(1.0f));
}

// Adds the difference between the light of a row's cells in this frame and before to Layer::changes, and keeps the
// means before in Layer::after for accumulate().
ARHOST_INLINE void find_change(const Denoising &denoising, const Layer &layer, std::int32_t row) {
    for (std::int32_t x = 0; x < layer.width; x += lanes) {
        const std::ptrdiff_t at = guide_at(layer, x, row), kept = history_at(layer, x, row);
        const Int surface = surfaces_at(layer, at);
        const Bool active = has_light_in(layer, surface);
        if (!any(active))
            continue;
        const Past past = past_of(denoising, layer, x, row, load3(layer.guides + position_guide, at),
                                  load3(layer.guides + normal_guide, at), surface, active);
        store3(layer.after, kept, past.light);
        if (layer.keeps_seen)
            store3(layer.after + seen_history, kept, past.seen);
        store(layer.after[moment_history] + kept, past.moments[0]);
        store(layer.after[moment_history + 1] + kept, past.moments[1]);
        store(layer.after[frames_history] + kept, past.frames);
        const Bool counts =
            active & (past.frames > Float(0.0f)) & (load(layer.light[0][variance_light] + at) == Float(sampled));
        const Float light = luminance(light_without_fireflies(layer, at, row, surface));
        const Float change = select(counts, min(light, Float(65504.0f)) - past.moments[0], Float(0.0f));
        alignas(64) float changes[lanes];
        store(changes, change);
        const unsigned mask = mask_of(counts.lane);
        Change *to = layer.changes + row / Layer::change_side * layer.changes_per_row() + x / Layer::change_side;
        for (int i = 0; i < lanes; ++i) {
            Change &sums = to[i / Layer::change_side];
            sums.count += static_cast<float>(mask >> i & 1);
            sums.sum += changes[i];
            sums.squares += changes[i] * changes[i];
        }
    }
}

// Returns how certain it is that the mean of a change is not 0: the square of Student's t.
ARHOST_INLINE float evidence_of(const Change &change) {
    constexpr float least_count = 8, negligible = 1e-6f; // variance
    if (change.count < least_count)
        return 0;
    const float mean = change.sum / change.count;
    const float variance = change.squares / change.count - mean * mean;
    return change.count * mean * mean / (variance > negligible ? variance : negligible);
}

// Returns how many frames may count in the means of a row's cells.
ARHOST_INLINE Float most_frames_of(const Denoising &denoising, const Layer &layer, int x, int row) {
    if (!denoising.finds_change)
        return Float(Denoising::most_frames);
    alignas(64) float frames[lanes];
    const int columns = layer.changes_per_row(), line = row / Layer::change_side;
    const int lines = (layer.height + Layer::change_side - 1) / Layer::change_side;
    for (int first = 0; first < lanes; first += Layer::change_side) {
        const int column = (x + first) / Layer::change_side;
        Change around{};
        for (int i = 0; i < 9; ++i) {
            const int near_line = line + i / 3 - 1, near_column = column + i % 3 - 1;
            if (near_line < 0 || near_line >= lines || near_column < 0 || near_column >= columns)
                continue;
            const Change &change = layer.changes[near_line * columns + near_column];
            around.count += change.count;
            around.sum += change.sum;
            around.squares += change.squares;
        }
        const float here = evidence_of(layer.changes[line * columns + column]), near = evidence_of(around);
        const float evidence = here > near ? here : near;
        constexpr float negligible = 4; // 5 % of unchanged squares have more
        const float doubt = negligible / (evidence > negligible ? evidence : negligible);
        const float most = Denoising::most_frames * doubt * doubt;
        for (int i = 0; i < Layer::change_side; ++i)
            frames[first + i] = most > 1 ? most : 1;
    }
    return load(frames);
}

// Values of variance_light: too few frames tell the variance; the light of a surface is not known.
constexpr float unknown = -1, no_light = -2;

// Accumulates a row: means over frames. The filter reads them from light[1]; the variance is that of the mean.
ARHOST_INLINE void accumulate(const Denoising &denoising, const Layer &layer, std::int32_t row) {
    for (std::int32_t x = 0; x < layer.width; x += lanes) {
        const std::ptrdiff_t at = guide_at(layer, x, row), kept = history_at(layer, x, row);
        const Int surface = surfaces_at(layer, at);
        const Bool active = has_light_in(layer, surface);
        if (!any(active)) {
            for (int i = 0; i < layer.history_count(); ++i)
                store(layer.after[i] + kept, Float(0.0f));
            continue;
        }
        const float *const *guides = layer.guides;
        const Vec3 position = load3(guides + position_guide, at), normal = load3(guides + normal_guide, at);
        const Vec3 light = light_without_fireflies(layer, at, row, surface);
        Past past;
        if (denoising.finds_change)
            past = {load3(layer.after, kept),
                    layer.keeps_seen ? load3(layer.after + seen_history, kept) : black(),
                    {load(layer.after[moment_history] + kept), load(layer.after[moment_history + 1] + kept)},
                    load(layer.after[frames_history] + kept)};
        else
            past = past_of(denoising, layer, x, row, position, normal, surface, active);
        const Float state = load(layer.light[0][variance_light] + at);
        const Bool is_new =
            (state == Float(sampled)) | ((state == Float(sampled_early)) & (past.frames == Float(0.0f)));
        // Of surfaces that are sampled in one of four frames, about the same time counts.
        const Bool in_turn = bool_of(layer.takes_turns) & ~is_kind(surface, specular_surface);
        const Float most_of_glossy = select(in_turn, Float(8.0f / 3), Float(8.0f));
        Float most = most_frames_of(denoising, layer, x, row);
        // The surroundings have no noise in mirrors and glass.
        const Bool shows_surroundings = is_kind(surface, specular_surface) & (surface < Int(mirrored_unit));
        if (denoising.camera_moved || denoising.before_from_now) { // highlights move over the surface
            const Bool is_glossy = is_kind(surface, glossy_surface) | bool_of(layer.holds == LayerLight::gloss);
            most = select(is_glossy, min(most, most_of_glossy), most);
        }
        if (denoising.camera_moved) {
            // Curved mirrors and glass show a surface elsewhere than at the position of the guides.
            most = select(is_kind(surface, specular_surface), min(most, Float(4.0f)), most);
            most = select(shows_surroundings, Float(1.0f), most);
        }
        const Float more = select(is_new, Float(1.0f), Float(0.0f));
        // A cell that is not sampled in this frame does not keep the light of before a change.
        const Bool counts = active & (is_new | (most > Float(2.0f)));
        const Float frames = select(counts, min(past.frames + more, most), Float(0.0f));
        const Float share = more / max(frames, Float(1.0f));
        Vec3 mean = past.light + (light - past.light) * share;
        const Float value = min(luminance(light), Float(65504.0f));
        const Float first = past.moments[0] + (value - past.moments[0]) * share,
                    second = past.moments[1] + (value * value - past.moments[1]) * share;
        Float variance = max(second - first * first, Float(0.0f)) / max(frames, Float(1.0f));
        variance = select(frames < Float(8.0f), select(shows_surroundings, Float(0.0f), Float(unknown)), variance);
        variance = select(frames > Float(0.0f), variance, Float(no_light));
        if (layer.keeps_seen) {
            const Vec3 now = load3(guides + albedo_guide, at);
            Vec3 seen = now;
            if (const Bool specular = active & is_kind(surface, specular_surface);
                any(specular) && !denoising.seen_moves()) {
                // Frames count in proportion to what they show, so that the product of the means is that of the
                // light.
                const auto weighted = [&](Float before, Float value, Float seen_before, Float seen_now)
                    __attribute__((always_inline)) {
                    const Float weight = seen_now * share;
                    const Float all = max(seen_before * (Float(1.0f) - share) + weight, Float(1e-6f));
                    return before + (value - before) * (weight / all);
                };
                mean = select(specular,
                              Vec3{weighted(past.light.x, light.x, past.seen.x, now.x),
                                   weighted(past.light.y, light.y, past.seen.y, now.y),
                                   weighted(past.light.z, light.z, past.seen.z, now.z)},
                              mean);
                // The video may change.
                const Float most = max(share, Float(1.0f / 8));
                seen = select(specular, past.seen + (now - past.seen) * most, now);
            }
            store3(layer.guides + albedo_guide, at, seen);
            store3(layer.after + seen_history, kept, select(active, seen, black()));
        }
        store3(layer.after, kept, select(active, mean, black()));
        store(layer.after[moment_history] + kept, select(active, first, Float(0.0f)));
        store(layer.after[moment_history + 1] + kept, select(active, second, Float(0.0f)));
        store(layer.after[distance_history] + kept,
              select(active, length(position - splat(denoising.camera.eye)), Float(0.0f)));
        store(layer.after[normal_history] + kept, float_of(select(active, packed_normal(normal), Int(0))));
        store(layer.after[surface_history] + kept, float_of(select(frames > Float(0.0f), surface, Int(0))));
        store(layer.after[frames_history] + kept, frames);
        store3(layer.light[1], at, select(active, mean, black()));
        store(layer.light[1][variance_light] + at, select(active, variance, Float(0.0f)));
    }
}

// Returns the variance of the light near cells whose history is too short to tell it, from their neighbours.
ARHOST_INLINE Float variance_of_neighbours(const Layer &layer, const float *const *light, std::ptrdiff_t at, int row,
                                           Int surface) {
    Float count(0.0f), first(0.0f), second(0.0f);
    for (int dy = -2; dy <= 2; ++dy) {
        if (row + dy < 0 || row + dy >= layer.height)
            continue;
        for (int dx = -2; dx <= 2; ++dx) {
            const std::ptrdiff_t there = at + dy * layer.guide_stride() + dx;
            const Bool same =
                (surfaces_at(layer, there) == surface) & (load(light[variance_light] + there) > Float(no_light));
            const Float value = luminance(load3(light, there));
            count = count + select(same, Float(1.0f), Float(0.0f));
            first = first + select(same, value, Float(0.0f));
            second = second + select(same, value * value, Float(0.0f));
        }
    }
    const Float scale = Float(1.0f) / max(count, Float(1.0f)), mean = first * scale;
    // Of a few pixels, the variance is uncertain, and mostly too small.
    return max(second * scale - mean * mean, Float(0.0f)) * (Float(1.0f) + Float(8.0f) * scale);
}

// Differences of the luminance below about half a code are filtered, however certain.
constexpr float least_variance = 1e-6f;

// Filters a row: a pass of the à-trous filter with 3×3 taps, 2^pass cells apart.
ARHOST_INLINE void filter(const Denoising &denoising, const Layer &layer, std::int32_t row, int pass) {
    const int step = 1 << pass;
    const float *const *from = layer.light[(pass + 1) & 1];
    float *const *to = layer.light[pass & 1];
    const float *const *guides = layer.guides;
    const std::ptrdiff_t down = layer.guide_stride();
    for (std::int32_t x = 0; x < layer.width; x += lanes) {
        const std::ptrdiff_t at = guide_at(layer, x, row);
        const Int surface = surfaces_at(layer, at);
        if (!any(has_light_in(layer, surface)))
            continue;
        const bool flat = !any(surface != Int(denoising.flat_surface)); // needs no test of positions and normals
        const Vec3 position = load3(guides + position_guide, at), normal = load3(guides + normal_guide, at);
        const Vec3 light = load3(from, at);
        const Float own = luminance(light);
        Float variance = load(from[variance_light] + at);
        const Bool has_light = variance > Float(no_light);
        const Bool fills = ~has_light & bool_of(layer.holds == LayerLight::objects); // resolve() fills catchers
        if (pass == 0)
            if (const Bool needed = (variance == Float(unknown)) | fills; any(needed))
                variance = select(needed, variance_of_neighbours(layer, from, at, row, surface), variance);
        // Surfaces are flat within the width of a tap, up to about twice the size of a pixel.
        // In curved mirrors they are not.
        const Float distance = length(position - splat(denoising.camera.eye)) *
                               select(is_kind(surface, specular_surface), Float(8.0f), Float(1.0f));
        const Float inverse_tolerance =
            Float(1.0f) / (distance * Float(2.0f * static_cast<float>(step * layer.cell_px) * denoising.pixel_angle) +
                           Float(1e-6f));
        // Guides do not have all edges of shadows in mirrors and glass.
        const Float tolerated = select(is_kind(surface, specular_surface), Float(16.0f), Float(36.0f));
        const Float own_weight = select(has_light, Float(0.25f), Float(0.0f)), least = max(variance, Float(0.0f));
        Vec3 sum = light * own_weight;
        Float total = own_weight, squares = least * own_weight * own_weight;
        for (int dy = -1; dy <= 1; ++dy) {
            if (row + dy * step < 0 || row + dy * step >= layer.height)
                continue;
            for (int dx = -1; dx <= 1; ++dx) {
                if (dx == 0 && dy == 0)
                    continue;
                const std::ptrdiff_t there = at + dy * step * down + dx * step;
                const Float of_other = load(from[variance_light] + there);
                const Int surface_there = surfaces_at(layer, there);
                const Bool same = (surface_there == surface) & (of_other > Float(no_light));
                if (!any(same))
                    continue;
                const Vec3 other = load3(from, there);
                const Float difference = luminance(other) - own;
                const Float spread = least + max(of_other, least) + Float(least_variance);
                const auto falling = [](Float a) __attribute__((always_inline)) {
                    const Float rest = max(Float(1.0f) - a, Float(0.0f));
                    return rest * rest;
                };
                const Float kernel((dx == 0 ? 2.0f : 1.0f) * (dy == 0 ? 2.0f : 1.0f) / 16);
                Float weight = kernel;
                if (!flat) {
                    const Float facing = max(dot(load3(guides + normal_guide, there), normal), Float(0.0f));
                    Float alike = facing * facing;
                    alike = alike * alike;
                    alike = alike * alike;
                    alike = alike * alike; // cos^16
                    const Float apart = abs(dot(load3(guides + position_guide, there) - position, normal));
                    weight = weight * alike * falling(apart * inverse_tolerance);
                }
                const Float plausible = falling(difference * difference / (spread * tolerated));
                weight = weight * select(has_light, plausible, Float(1.0f));
                weight = max(weight, select(fills, Float(1e-6f), Float(0.0f))); // any light is better than none
                weight = select(same, weight, Float(0.0f));
                sum = sum + other * weight;
                squares = squares + weight * weight * max(of_other, least);
                total = total + weight;
            }
        }
        const Bool is_known = total > Float(0.0f);
        const Float scale = Float(1.0f) / max(total, Float(1e-30f));
        store3(to, at, select(is_known, sum * scale, black()));
        store(to[variance_light] + at, select(is_known, squares * scale * scale, Float(no_light)));
    }
}

// Writes pixels of a row that virtual objects do not affect.
ARHOST_INLINE void write_untouched(const Denoising &denoising, int x, int row, int width) {
    if (!denoising.image.linear) {
        __builtin_memset(denoising.image.rgba + std::size_t{denoising.image.stride} * row + std::size_t{4} * x, 0,
                         4 * width);
        return;
    }
    constexpr std::uint16_t one = 0x3c00;
    alignas(64) static constexpr std::uint16_t four[32] = {0,   0,   0,   0,   one, one, one, 0,   0,   0,   0,
                                                           0,   one, one, one, 0,   0,   0,   0,   0,   one, one,
                                                           one, 0,   0,   0,   0,   0,   one, one, one, 0};
    auto *to = reinterpret_cast<std::uint8_t *>(denoising.image.linear) + std::size_t{denoising.image.stride} * row +
               std::size_t{16} * x;
    for (int column = 0; column < width; column += 4, to += sizeof four)
        if (width - column >= 4)
            __builtin_memcpy(to, four, sizeof four);
        else
            __builtin_memcpy(to, four, 16 * (width - column));
}

// The light of the catchers near the pixels of a row, interpolated between cells.
class InterpolatedCatchers {
public:
    // `x`: even.
    ARHOST_INLINE InterpolatedCatchers(const Denoising &denoising, const Layer &layer, int x, int row)
        : layer_(layer), light_(layer_.light[(layer_.filter_passes() + 1) & 1]),
          flat_surface_(denoising.flat_surface), x_(x), row_(row) {}

    // Returns the light of surfaces that the pixels, or those beside them, show.
    ARHOST_INLINE Vec3 of(Int surface) const {
        Sums sums{black(), black(), Float(0.0f), Float(0.0f)};
        if (layer_.cell_px == 1) {
            add(sums, guide_at(layer_, x_, row_), lane_numbers(), surface, Float(1.0f));
            const Bool missing = sums.total == Float(0.0f); // their light is that of the pixels around
            for (int i = 0; i < 9 && any(missing); ++i)
                if (const int y = row_ + i / 3 - 1; y >= 0 && y < layer_.height)
                    add(sums, guide_at(layer_, x_ + i % 3 - 1, y), lane_numbers(), surface,
                        select(missing, Float(1.0f), Float(0.0f)));
        } else {
            const Int odd = lane_numbers() & Int(1), nearest = Int(1) + (lane_numbers() >> Int(1));
            const int beside = row_ / 2 + (row_ % 2 == 0 ? -1 : 1);
            for (int i = 0; i < 4; ++i) {
                const int cell_row = i >> 1 && beside >= 0 && beside < layer_.height ? beside : row_ / 2;
                const float weight = (i & 1 ? 0.25f : 0.75f) * (i >> 1 ? 0.25f : 0.75f);
                add(sums, guide_at(layer_, x_ / 2 - 1, cell_row), i & 1 ? nearest - Int(1) + odd + odd : nearest,
                    surface, Float(weight));
            }
        }
        const Bool none = sums.total == Float(0.0f); // such as in a corner of two catchers
        const Float total = max(select(none, sums.total_of_all, sums.total), Float(1e-6f));
        return select(none, sums.of_all, sums.light) * (Float(1.0f) / total);
    }

private:
    struct Sums {
        Vec3 light, of_all; // of the surface, and of all catchers
        Float total, total_of_all;
    };
    // Adds the light of cells, which are `cell` after the one at the index `first`.
    ARHOST_INLINE void add(Sums &sums, std::ptrdiff_t first, Int cell, Int surface, Float weight) const {
        const Int there = bits_of(pick(layer_.guides[surface_guide] + first, cell));
        const Bool is_unchanged = there == Int(unchanged_surface);
        const Bool known = is_unchanged | (is_kind(there, real_surface) &
                                           (pick(light_[variance_light] + first, cell) > Float(no_light)));
        if (!any(known))
            return;
        const auto channel = [&](int row) __attribute__((always_inline)) {
            return select(known & ~is_unchanged, pick(light_[row] + first, cell), Float(0.0f)) * weight;
        };
        const Vec3 light{channel(0), channel(1), channel(2)};
        const Bool same = known & ((is_unchanged & (surface == Int(flat_surface_))) | (there == surface));
        sums.light = sums.light + select(same, light, black());
        sums.total = sums.total + select(same, weight, Float(0.0f));
        sums.of_all = sums.of_all + select(known, light, black());
        sums.total_of_all = sums.total_of_all + select(known, weight, Float(0.0f));
    }

    const Layer &layer_;
    const float *const *light_;
    int flat_surface_, x_, row_;
};

// Returns what Denoising::view shows of the pixels of a row.
ARHOST_INLINE Vec3 viewed(const Denoising &denoising, const InterpolatedCatchers &catchers, int x, int row,
                          Int surface) {
    const Layer &objects = denoising.objects, &cells = denoising.catchers;
    const Bool is_caught = has_light_in(cells, surface);
    const Int cell = cells.cell_px == 1 ? lane_numbers() : lane_numbers() >> Int(1);
    const auto value = [&](const float *of_objects, const float *of_cells) __attribute__((always_inline)) {
        return select(is_caught, pick(of_cells, cell), load(of_objects));
    };
    const std::ptrdiff_t at = guide_at(objects, x, row),
                         at_cell = guide_at(cells, x / cells.cell_px, row / cells.cell_px);
    const auto grey = [](Float a) { return Vec3{a, a, a}; };
    switch (denoising.view) {
    case View::history: {
        const std::ptrdiff_t kept = history_at(objects, x, row),
                             kept_cell = history_at(cells, x / cells.cell_px, row / cells.cell_px);
        // Histories have no margin that pick() may read.
        const Float of_cells = gather(cells.after[frames_history] + kept_cell, select(is_caught, cell, Int(0)));
        return grey(select(is_caught, of_cells, load(objects.after[frames_history] + kept)) *
                    Float(1 / Denoising::most_frames));
    }
    case View::variance: {
        const auto variance = [](const Layer &layer) {
            return layer.light[(layer.filter_passes() + 1) & 1][variance_light];
        };
        constexpr float white = 0.1f; // standard deviation
        return grey(sqrt(max(value(variance(objects) + at, variance(cells) + at_cell), Float(0.0f))) *
                    Float(1 / white));
    }
    case View::normals: {
        const auto component = [&](int i) __attribute__((always_inline)) {
            const Float normal =
                value(objects.guides[normal_guide + i] + at, cells.guides[normal_guide + i] + at_cell);
            return normal * Float(0.5f) + Float(0.5f);
        };
        return {component(0), component(1), component(2)};
    }
    default: {
        const Vec3 change = catchers.of(surface);
        return select(is_caught, denoising.view == View::shadow ? (white() + change) * Float(0.5f) : change, black());
    }
    }
}

// Writes a row of the image.
ARHOST_INLINE Rectangle resolve(const Denoising &denoising, std::int32_t row) {
    const Layer &layer = denoising.objects;
    const float *const *from = layer.light[(layer.filter_passes() + 1) & 1];
    const float *const *guides = layer.guides;
    Rectangle drawn{layer.width, row, 0, row + 1};
    for (std::int32_t x = 0; x < layer.width; x += lanes) {
        const int width = layer.width - x < lanes ? layer.width - x : lanes;
        const Int taps = load(denoising.taps + history_at(layer, x, row));
        const std::ptrdiff_t at = guide_at(layer, x, row),
                             at_real = denoising.has_gloss ? guide_at(denoising.catchers, x, row) : 0;
        const Int own_surface = surfaces_at(layer, at);
        const bool is_picture = denoising.view == View::picture;
        const Bool plain = is_picture ? taps == Int(static_cast<int>(only_own)) : bool_of(true);
        if (!any(~plain | ((own_surface != Int(0)) & (own_surface != Int(unchanged_surface))))) {
            write_untouched(denoising, x, row, width);
            continue;
        }
        LinearBlock linear{black(), black()};
        const InterpolatedCatchers catchers(denoising, denoising.catchers, x, row),
            glosses(denoising, denoising.has_gloss ? denoising.gloss : denoising.catchers, x, row);
        // Of glossy catchers; `matt`: their diffuse light without virtual objects.
        Vec3 gloss = black(), matt = black();
        Float real_share(0.0f);
        // `light`, `albedo`: of virtual objects.
        const auto add = [&](Int surface, Vec3 light, Vec3 albedo, Vec3 of_matt, Float share, Bool here)
            __attribute__((always_inline)) {
            const Bool is_virtual = here & has_light_in(layer, surface), is_real = here & ~is_virtual;
            linear.added = linear.added + select(is_virtual, light * albedo * share, black());
            Vec3 transmittance = white();
            if (const Bool changed = is_real & has_light_in(denoising.catchers, surface); any(changed))
                transmittance = transmittance + select(changed, catchers.of(surface), black());
            linear.transmittance = linear.transmittance + select(is_real, transmittance * share, black());
            real_share = real_share + select(is_real, share, Float(0.0f));
            if (!denoising.has_gloss)
                return;
            if (const Bool changed = is_real & has_light_in(denoising.catchers, surface); any(changed)) {
                gloss = gloss + select(changed, glosses.of(surface) * share, black());
                matt = matt + select(changed, of_matt * share, black());
            }
        };
        if (is_picture)
            add(own_surface, load3(from, at), load3(guides + albedo_guide, at),
                load3(denoising.catchers.guides + albedo_guide, at_real), Float(1.0f), plain);
        else
            linear = {select(own_surface == Int(0), black(), viewed(denoising, catchers, x, row, own_surface)),
                      select(own_surface == Int(0), white(), black())};
        const Bool edges = ~plain & (lane_numbers() < Int(width));
        if (any(edges)) {
            for (int i = 0; i < tap_count; ++i) {
                const Int tap = (taps >> Int(4 * i)) & Int(15);
                const Int dy = to_int(to_float(tap) * Float(1 / 3.0f) + Float(0.01f)) - Int(1),
                          dx = tap - (dy + Int(1)) * Int(3) - Int(1);
                const Bool here = edges & (tap != Int(no_tap));
                const Int there =
                    select(here, Int(static_cast<int>(at)) + lane_numbers() + dy * Int(layer.guide_stride()) + dx,
                           Int(Layer::margin));
                const Int surface = select(here, bits_of(gather(guides[surface_guide], there)), Int(0));
                const Vec3 of_matt =
                    denoising.has_gloss ? gather3(denoising.catchers.guides + albedo_guide, there) : black();
                add(surface, gather3(from, there), gather3(guides + albedo_guide, there), of_matt,
                    Float(1.0f / tap_count), edges);
            }
        }
        linear.transmittance = bounded_for_halves(linear.transmittance);
        if (denoising.has_gloss && is_picture) {
            const auto positive = [](Vec3 a) __attribute__((always_inline)) {
                return Vec3{max(a.x, Float(0.0f)), max(a.y, Float(0.0f)), max(a.z, Float(0.0f))};
            };
            linear.added = linear.added + positive(gloss);
            const Float behind = Float(1.0f) / max(real_share, Float(1e-3f)); // means over what is behind objects
            const Float across = to_float(lane_numbers() + Int(x)) + Float(0.5f),
                        down(static_cast<float>(row) + 0.5f);
            remove_covered(denoising.video, positive(-gloss) * behind, matt * behind, across, down, linear);
        }
        linear.added = bounded_for_halves(linear.added);
        bool affected = false;
        if (denoising.image.linear) {
            affected = write_linear(denoising.image, x, row, width, 1, linear, lanes);
        } else {
            const Int pixels = straight_of(denoising.image, linear);
            __builtin_memcpy(denoising.image.rgba + std::size_t{denoising.image.stride} * row + std::size_t{4} * x,
                             &pixels, 4 * width);
            affected = any(((pixels >> Int(24)) != Int(0)) & (lane_numbers() < Int(width)));
        }
        if (affected) {
            drawn.x0 = x < drawn.x0 ? x : drawn.x0;
            drawn.x1 = x + width > drawn.x1 ? x + width : drawn.x1;
        }
    }
    return drawn;
}

} // namespace

Steps steps() {
    return {find_change, accumulate, filter, resolve};
}

} // namespace arhost::raytracer_common::ARHOST_ISA
