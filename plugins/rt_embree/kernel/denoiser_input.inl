// SPDX-License-Identifier: Apache-2.0
//
// Writes the input of the denoiser: the guides and the light of a block, and at edges the surfaces that a pixel
// shows.
#pragma once
#include "path.inl"

// The cells of a layer that a block of pixels covers.
struct BlockCells {
    std::ptrdiff_t first; // index of guides and light
    int width, height;
};
ARHOST_INLINE BlockCells cells_of(const Layer &layer, int x, int y, int width, int height) {
    const int side = layer.cell_px;
    return {guide_at(layer, x / side, y / side), (width + side - 1) / side, (height + side - 1) / side};
}
// `values`: block / cell_px per row.
ARHOST_INLINE void write_cells(const Layer &layer, const BlockCells &cells, float *plane, const void *values) {
    const int per_row = block / layer.cell_px;
    for (int row = 0; row < cells.height; ++row) {
        float *to = plane + cells.first + row * layer.guide_stride();
        const float *from = static_cast<const float *>(values) + per_row * row;
        if (cells.width == block) // sizes that the compiler knows
            __builtin_memcpy(to, from, 4 * block);
        else if (cells.width == block / 2)
            __builtin_memcpy(to, from, 2 * block);
        else
            __builtin_memcpy(to, from, 4 * cells.width);
    }
}
ARHOST_INLINE void write_surface(const Layer &layer, const BlockCells &cells, int surface) {
    alignas(64) int values[lanes];
    store(values, Int(surface));
    write_cells(layer, cells, layer.guides[surface_guide], values);
}

// Marks the pixels of a block as unchanged.
ARHOST_INLINE void write_unchanged(const Frame &frame, int x, int y, int width, int height) {
    for (const Layer *layer : {&frame.denoising->objects, &frame.denoising->catchers})
        write_surface(*layer, cells_of(*layer, x, y, width, height), unchanged_surface);
}

// Writes the guides and the mean light of the catchers of a block. A cell shows the catcher of its first pixel that
// has one, so that it shows the same in each frame.
ARHOST_INLINE void write_catchers(const Frame &frame, const Scratch &scratch, int first_pixel, Float scale, int x,
                                  int y, int width, int height) {
    const Denoising &denoising = *frame.denoising;
    const Layer &layer = denoising.catchers;
    const BlockCells cells = cells_of(layer, x, y, width, height);
    const int phase = denoising.catcher_phase;
    const float *surfaces = scratch.guide[surface_guide] + first_pixel;
    const unsigned caught = mask_of(is_kind(bits_of(load(surfaces)), real_surface).lane);
    if (caught == 0)
        return write_surface(layer, cells, 0);
    alignas(64) float values[lanes];
    const auto write = [&](float *plane, Float row) __attribute__((always_inline)) {
        store(values, row);
        write_cells(layer, cells, plane, values);
    };
    if (layer.cell_px == 1) {
        const Int all = bits_of(load(surfaces));
        const Bool is_real = is_kind(all, real_surface);
        for (int i = 0; i < albedo_guide; ++i)
            write(layer.guides[i], load(scratch.guide[i] + first_pixel));
        write(layer.guides[surface_guide], float_of(select(is_real, all, Int(0))));
        for (int i = 0; i < 3; ++i) {
            const Float change = load(scratch.sum[change_row + i] + first_pixel) * scale;
            write(layer.light[0][i], select(is_real, change, Float(0.0f)));
        }
        const Bool is_sampled = (phase_of_lanes() == Int(phase)) | bool_of(phase < 0);
        write(layer.light[0][variance_light], select(is_sampled, Float(sampled), Float(not_sampled)));
        if (!frame.scene.has_gloss)
            return;
        for (int i = 0; i < 3; ++i) {
            const auto mean = [&](int row) __attribute__((always_inline)) {
                return load(scratch.sum[row + i] + first_pixel) * scale;
            };
            write(layer.guides[albedo_guide + i], mean(matt_row));
            write(denoising.gloss.light[0][i], select(is_real, mean(light_row) - mean(covered_row), Float(0.0f)));
        }
        return write(denoising.gloss.light[0][variance_light], Float(sampled));
    }
    constexpr int cell_count = 4;
    const auto pixel_of = [](int cell, int i) __attribute__((always_inline)) {
        return 2 * block * (cell >> 1) + 2 * (cell & 1) + block * (i >> 1) + (i & 1);
    };
    alignas(64) int shown[lanes] = {}, is_empty[lanes] = {}, pixels[4][lanes] = {};
    for (int cell = 0; cell < cell_count; ++cell) {
        is_empty[cell] = -1;
        for (int i = 0; i < 4; ++i) {
            const int pixel = pixel_of(cell, i);
            pixels[i][cell] = pixel;
            if ((caught >> pixel & 1) != 0 && is_empty[cell] != 0) {
                shown[cell] = pixel;
                is_empty[cell] = 0;
            }
        }
    }
    const Bool exists = load(is_empty) == Int(0);
    const Int pixel = load(shown), surface = select(exists, bits_of(pick(surfaces, pixel)), Int(0));
    for (int i = 0; i < albedo_guide; ++i)
        write(layer.guides[i], pick(scratch.guide[i] + first_pixel, pixel));
    write(layer.guides[surface_guide], float_of(surface));
    Vec3 light = black();
    Float count(0.0f);
    for (int i = 0; i < 4; ++i) {
        if (phase >= 0 && i != phase)
            continue;
        const Int of = load(pixels[i]);
        const Bool counts = exists & (bits_of(pick(surfaces, of)) == surface);
        const auto change = [&](int row) __attribute__((always_inline)) {
            return select(counts, pick(scratch.sum[change_row + row] + first_pixel, of), Float(0.0f));
        };
        light = light + Vec3{change(0), change(1), change(2)};
        count = count + select(counts, Float(1.0f), Float(0.0f));
    }
    light = light * (scale / max(count, Float(1.0f)));
    write(layer.light[0][0], light.x);
    write(layer.light[0][1], light.y);
    write(layer.light[0][2], light.z);
    write(layer.light[0][variance_light], select(count > Float(0.0f), Float(sampled), Float(not_sampled)));
}

// Writes the guides and the light of a block. `count`: the number of samples.
ARHOST_INLINE void write_for_denoiser(const Frame &frame, const Scratch &scratch, int first_pixel,
                                      std::uint32_t count, int x, int y, int width, int height) {
    const Denoising &denoising = *frame.denoising;
    const Layer &layer = denoising.objects;
    const Float scale(1.0f / static_cast<float>(count));
    if (frame.scene.has_catchers)
        write_catchers(frame, scratch, first_pixel, scale, x, y, width, height);
    const BlockCells cells = cells_of(layer, x, y, width, height);
    const auto guide = [&](int row) __attribute__((always_inline)) {
        return load(scratch.guide[row] + first_pixel);
    };
    const Int surface = bits_of(guide(surface_guide));
    write_cells(layer, cells, layer.guides[surface_guide], scratch.guide[surface_guide] + first_pixel);
    if (!any(surface != Int(denoising.flat_surface)))
        return;
    for (int i = 0; i < albedo_guide; ++i)
        write_cells(layer, cells, layer.guides[i], scratch.guide[i] + first_pixel);
    alignas(64) float values[lanes];
    const Bool is_virtual = has_light_in(layer, surface), is_specular = is_kind(surface, specular_surface);
    const Float samples = load(scratch.sum[coverage_row] + first_pixel); // more at edges in mirrors
    for (int i = 0; i < 3; ++i) {
        const Float seen = max(load(scratch.seen[i] + first_pixel) / samples, Float(least_divisor));
        const Float albedo = select(is_specular, seen, guide(albedo_guide + i));
        store(values, albedo);
        write_cells(layer, cells, layer.guides[albedo_guide + i], values);
        const Float light = load(scratch.sum[light_row + i] + first_pixel) / (albedo * samples);
        store(values, select(is_virtual, light, Float(0.0f)));
        write_cells(layer, cells, layer.light[0][i], values);
    }
    const int phase = denoising.object_phase;
    const Bool in_turn = is_specular | (phase_of_lanes() == Int(phase)) | bool_of(phase < 0);
    const Bool is_sampled = objects_in_turn(frame, scratch, first_pixel);
    store(values, select(in_turn, Float(sampled), select(is_sampled, Float(sampled_early), Float(not_sampled))));
    write_cells(layer, cells, layer.light[0][variance_light], values);
}

// Returns the pixels of a row that differ from a neighbour.
ARHOST_INLINE Bool edges_at(const Frame &frame, int x, int y) {
    const Denoising &denoising = *frame.denoising;
    const Layer &layer = denoising.objects;
    const float *const *guides = layer.guides;
    const std::ptrdiff_t at = guide_at(layer, x, y), down = layer.guide_stride();
    const auto flat_if_unchanged = [&](Int surface) __attribute__((always_inline)) {
        return select(surface == Int(unchanged_surface), Int(denoising.flat_surface), surface);
    };
    const Int surface = flat_if_unchanged(surfaces_at(layer, at));
    Bool differs = surface != Int(denoising.flat_surface);
    if (!any(differs)) {
        for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx)
                if ((dx == 0) != (dy == 0) && y + dy >= 0 && y + dy < layer.height)
                    differs = differs | (flat_if_unchanged(surfaces_at(layer, at + dy * down + dx)) != surface);
        if (!any(differs))
            return differs;
    }
    const Vec3 position = load3(guides + position_guide, at), normal = load3(guides + normal_guide, at);
    const Float tolerance = length(position - splat(frame.camera.eye)) * Float(3 * denoising.pixel_angle);
    Bool edge = bool_of(false);
    for (int i = 0; i < 4; ++i) {
        const int dx = i == 0 ? -1 : i == 1 ? 1 : 0, dy = i == 2 ? -1 : i == 3 ? 1 : 0;
        if (y + dy < 0 || y + dy >= layer.height)
            continue;
        const std::ptrdiff_t there = at + dy * down + dx;
        const Int other = flat_if_unchanged(surfaces_at(layer, there));
        const Bool inside = Int(-1) < (lane_numbers() + Int(x + dx));
        const Bool right = (lane_numbers() + Int(x + dx)) < Int(layer.width);
        const Bool folded = (other != Int(0)) & ~is_kind(surface, specular_surface) &
                            (surface != Int(denoising.flat_surface)) &
                            ((dot(load3(guides + normal_guide, there), normal) < Float(0.8f)) |
                             (abs(dot(load3(guides + position_guide, there) - position, normal)) > tolerance));
        edge = edge | (inside & right & ((((other ^ surface) & Int(mirrored_unit - 1)) != Int(0)) | folded));
    }
    return edge & ((lane_numbers() + Int(x)) < Int(layer.width));
}

// A pixel at an edge, and its ray in Rays::blocks.
struct EdgePixel {
    std::int32_t x, y;
    const float *ray;
};

// Finds the taps of two pixels. Lanes are their rays.
ARHOST_INLINE void find_taps_of(const Frame &frame, const EdgePixel &one, const EdgePixel &other) {
    const Denoising &denoising = *frame.denoising;
    const Layer &layer = denoising.objects;
    const Bool is_one = lane_numbers() < Int(tap_count);
    const auto row = [&](int i) __attribute__((always_inline)) {
        return select(is_one, Float(one.ray[lanes * i]), Float(other.ray[lanes * i]));
    };
    const auto rays = [&](int first, float z) __attribute__((always_inline)) {
        first *= frame.rays.dimensions;
        return Vec3{row(first), row(first + 1), frame.rays.dimensions == 3 ? row(first + 2) : Float(z)};
    };
    // A lattice with a different row and column for each ray.
    static_assert(lanes == 2 * tap_count);
    alignas(64) static constexpr float columns[lanes] = {3, 6, 1, 4, 7, 2, 5, 0, 3, 6, 1, 4, 7, 2, 5, 0};
    const auto offset = [](Float number) __attribute__((always_inline)) {
        return (number + Float(0.5f)) * Float(1.0f / tap_count) - Float(0.5f);
    };
    const Vec3 in_camera = rays(0, 1) + rays(1, 0) * offset(load(columns)) +
                           rays(2, 0) * offset(to_float(lane_numbers() & Int(tap_count - 1)));
    const Vec3 direction = transform(frame.camera.world_from_camera, in_camera);
    const Bool has_ray = direction.x == direction.x;
    const PrimaryHits hits = trace_primary(frame.scene, splat(frame.camera.eye), direction, has_ray, has_ray);
    Int surface(0);
    Float far(0.0f);
    if (any(hits.is_virtual)) {
        surface = select(hits.is_virtual, surface_of(frame.scene, hits.rays.hit, hits.is_virtual), surface);
        far = select(hits.is_virtual, load(hits.rays.ray.tfar), far);
    }
    if (any(hits.caught)) {
        surface = select(hits.caught, surface_of(frame.scene, hits.catcher_rays.hit, hits.caught), surface);
        far = select(hits.caught, load(hits.catcher_rays.ray.tfar), far);
    }
    const Vec3 position = splat(frame.camera.eye) + direction * far;
    const float *const *guides = layer.guides;
    Int chosen = select(surface == Int(0), Int(no_tap), Int(own_tap));
    Float least(1e30f);
    for (int tap = 0; tap < 9; ++tap) {
        const int dx = tap % 3 - 1, dy = tap / 3 - 1;
        const bool inside[] = {one.y + dy >= 0 && one.y + dy < layer.height,
                               other.y + dy >= 0 && other.y + dy < layer.height};
        const std::ptrdiff_t at[] = {guide_at(layer, one.x + dx, inside[0] ? one.y + dy : one.y),
                                     guide_at(layer, other.x + dx, inside[1] ? other.y + dy : other.y)};
        const auto surface_there = [&](int i) __attribute__((always_inline)) {
            return Int(inside[i] ? __builtin_bit_cast(int, guides[surface_guide][at[i]]) : 0);
        };
        const Int number = select(is_one, surface_there(0), surface_there(1)) & Int(mirrored_unit - 1);
        const Bool flat =
            (surface == Int(denoising.flat_surface)) & ((number == surface) | (number == Int(unchanged_surface)));
        const Bool same = (flat | (number == surface)) & (surface != Int(0));
        if (!any(same))
            continue;
        const auto value = [&](int guide) __attribute__((always_inline)) {
            return select(is_one, Float(guides[guide][at[0]]), Float(guides[guide][at[1]]));
        };
        const auto vector = [&](int first) __attribute__((always_inline)) {
            return Vec3{value(first), value(first + 1), value(first + 2)};
        };
        const Float from_plane = abs(dot(vector(normal_guide), vector(position_guide) - position));
        const Float apart = select(flat | is_kind(surface, specular_surface), Float(0.0f), from_plane) +
                            Float(tap == own_tap ? 0.0f : 0.05f * denoising.pixel_angle) * far;
        const Bool nearer = same & (apart < least);
        least = select(nearer, apart, least);
        chosen = select(nearer, Int(tap), chosen);
    }
    alignas(64) int values[lanes];
    store(values, chosen);
    unsigned taps[2] = {};
    for (int i = 0; i < lanes; ++i)
        taps[i / tap_count] |= static_cast<unsigned>(values[i]) << 4 * (i % tap_count);
    denoising.taps[history_at(layer, one.x, one.y)] = taps[0];
    denoising.taps[history_at(layer, other.x, other.y)] = taps[1];
}

// Finds the taps of the pixels of a tile.
ARHOST_INLINE void find_taps(const Frame &frame, const Tile &tile) {
    const Denoising &denoising = *frame.denoising;
    const Layer &layer = denoising.objects;
    const Rectangle &all = tile.pixels;
    bool has_edges = false;
    for (int y = all.y0; y < all.y1; ++y)
        for (int x = all.x0; x < all.x1; x += lanes) {
            const Bool edges = edges_at(frame, x, y);
            store(denoising.taps + history_at(layer, x, y), select(edges, Int(0), Int(only_own)));
            has_edges = has_edges || any(edges);
        }
    if (!has_edges)
        return;
    const float *rays = frame.rays.blocks + tile.first_block * frame.rays.block_size();
    EdgePixel waiting{};
    for_each_block(all, [&](int number, int x0, int y0, int width, int height) {
        for (int row = 0; row < height; ++row)
            for (int column = 0; column < width; ++column) {
                const int x = x0 + column, y = y0 + row;
                if (denoising.taps[history_at(layer, x, y)] == only_own)
                    continue;
                const EdgePixel pixel{x, y, rays + number * frame.rays.block_size() + block * row + column};
                if (waiting.ray)
                    find_taps_of(frame, waiting, pixel);
                waiting = waiting.ray ? EdgePixel{} : pixel;
            }
    });
    if (waiting.ray)
        find_taps_of(frame, waiting, waiting);
}
