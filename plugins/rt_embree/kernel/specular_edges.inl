// SPDX-License-Identifier: Apache-2.0
//
// Edges of what mirrors and glass show. The denoiser keeps them sharp, so they would be jagged: pixels there get more
// samples.
#pragma once
#include "denoiser_input.inl"

// The surfaces and the light that the pixels of a tile show, with a margin of one pixel.
struct TileSurfaces {
    static constexpr int stride = tile_side + 2;
    int surface[stride * stride];
    float seen[stride * stride]; // luminance of Scratch::seen
    static constexpr int at(int x, int y) { return (y + 1) * stride + x + 1; }
};

// Returns whether a pixel shows the edge of a reflected or refracted surface, or of a lamp.
inline bool shows_specular_edge(const TileSurfaces &tile, int x, int y) {
    const int at = TileSurfaces::at(x, y), surface = tile.surface[at];
    if ((surface & 3) != specular_surface)
        return false;
    for (const int there : {at - 1, at + 1, at - TileSurfaces::stride, at + TileSurfaces::stride}) {
        const int differs = tile.surface[there] ^ surface;
        if ((differs & (mirrored_unit - 1)) != 0)
            continue; // the edge of the mirror itself
        const float light = tile.seen[at], other = tile.seen[there];
        if (differs != 0 || __builtin_fabsf(light - other) > 0.25f * (light + other) + 0.02f)
            return true;
    }
    return false;
}

// Adds samples to pixels that show an edge in a mirror or in glass.
ARHOST_INLINE void smooth_specular_edges(Work &work, const Tile &tile) {
    const Frame &frame = work.frame;
    Scratch &scratch = work.scratch;
    const Rectangle &all = tile.pixels;
    bool any_specular = false;
    for_each_block(all, [&](int number, int, int, int, int) {
        any_specular = any_specular ||
                       any(is_kind(bits_of(load(scratch.guide[surface_guide] + number * lanes)), specular_surface));
    });
    if (!any_specular)
        return;
    TileSurfaces surfaces{};
    for_each_block(all, [&](int number, int x0, int y0, int width, int height) {
        alignas(64) int surface[lanes];
        alignas(64) float seen[lanes];
        const auto sum = [&](int row) __attribute__((always_inline)) {
            return load(scratch.seen[row] + number * lanes);
        };
        store(surface, bits_of(load(scratch.guide[surface_guide] + number * lanes)));
        store(seen, luminance({sum(0), sum(1), sum(2)}) * Float(1.0f / static_cast<float>(frame.sample_count)));
        for (int row = 0; row < height; ++row)
            for (int column = 0; column < width; ++column) {
                const int to = TileSurfaces::at(x0 - all.x0 + column, y0 - all.y0 + row);
                surfaces.surface[to] = surface[block * row + column];
                surfaces.seen[to] = seen[block * row + column];
            }
    });
    std::uint16_t edges[tile_pixels / lanes];
    bool has_edges = false;
    for_each_block(all, [&](int number, int x0, int y0, int width, int height) {
        edges[number] = 0;
        for (int row = 0; row < height; ++row)
            for (int column = 0; column < width; ++column)
                if (shows_specular_edge(surfaces, x0 - all.x0 + column, y0 - all.y0 + row))
                    edges[number] = static_cast<std::uint16_t>(edges[number] | 1u << (block * row + column));
        has_edges = has_edges || edges[number] != 0;
    });
    if (!has_edges)
        return;
    const float *rays = frame.rays.blocks + tile.first_block * frame.rays.block_size();
    const arhost::raytracer_common::Sample &first = frame.samples[frame.sample_count - 1];
    constexpr std::uint32_t more_samples = 3;
    // With the first one, in each quarter of the pixel; around the centre, if the first one is there.
    constexpr arhost::raytracer_common::Sample around[] = {{0, -0.47f}, {0.41f, 0.235f}, {-0.41f, 0.235f}};
    const bool is_central = frame.denoising->seen_moves();
    for (std::uint32_t i = 1; i <= more_samples && frame.goes_on(frame.progress); ++i) {
        const auto half_a_pixel_further = [](float a) { return a < 0 ? a + 0.5f : a - 0.5f; };
        arhost::raytracer_common::Sample at = is_central ? around[i - 1] : first;
        if (!is_central && (i & 1) != 0)
            at.x = half_a_pixel_further(at.x);
        if (!is_central && (i & 2) != 0)
            at.y = half_a_pixel_further(at.y);
        work.sample = frame.first_random + (i << 28); // far from those of all frames
        for_each_block(all, [&](int number, int, int, int, int) {
            if (edges[number] == 0)
                return;
            const Bool active = ((Int(edges[number]) >> lane_numbers()) & Int(1)) == Int(1);
            const Vec3 direction = direction_in_world(frame, rays + number * frame.rays.block_size(), at.x, at.y);
            if (!shade_specular_again(work, number * lanes, direction, active & (direction.x == direction.x)))
                edges[number] = 0;
        });
        trace_queued_rays(work, [](Work &of, std::uint32_t depth) { trace_path_packet(of, depth); });
        for_each_block(all, [&](int number, int, int, int, int) {
            if (edges[number] != 0)
                accumulate_path(frame, scratch, number * lanes);
        });
    }
}
