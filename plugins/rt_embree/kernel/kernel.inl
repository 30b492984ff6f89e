// SPDX-License-Identifier: Apache-2.0
//
// The integrator, which renders a tile in blocks of 4×4 pixels. base.cpp, avx2.cpp and avx512.cpp each define
// ARHOST_ISA and include this file.
#include "kernel.hpp"
#include "packet.hpp"

namespace rt_embree::ARHOST_ISA {
namespace {

// Included inside the namespace so that each instruction set has its own copy of the functions.
#include "scatter.inl"

constexpr int block = 4; // side of a block, px

// Traces the primary rays of a block and shades their hits. Returns the alpha of each pixel, and sets `coloured` if
// any of the pixels can have radiance. Catchers do not hide the virtual objects behind them; occluders hide
// everything.
ARHOST_INLINE Float primary(Work &work, int first_pixel, Vec3 direction, Bool active, bool &coloured) {
    const Scene &scene = work.frame.scene;
    const Vec3 eye = splat(work.frame.camera.eye);
    const Paths paths{lane_numbers() + Int(first_pixel), first_pixel, white(), 0};
    RTCRayHit16 rays;
    set_ray(rays.ray, eye, direction, Float(far_away), Int(virtual_masks | occluder_mask));
    const Bool hit = trace(scene, scene.root, make_query(Coherence::coherent), rays, active);
    Bool occluded = bool_of(false);
    if (scene.has_occluders)
        for_each_object(scene, rays.hit, hit, [&](const Object &object, Bool here) {
            if (object.role == ARHOST_ROLE_OCCLUDER)
                occluded = occluded | here;
        });
    const Bool is_virtual = hit & ~occluded, rest = active & ~is_virtual;

    coloured = any(is_virtual) || (scene.has_catchers && scene.coloured_shadows);
    if (coloured)
        for (float *plane : work.scratch.radiance)
            store(plane + first_pixel, Float(0.0f));
    Float alpha = select(is_virtual, Float(1.0f), Float(0.0f));
    if (scene.has_catchers && any(rest)) {
        RTCRayHit16 to_catcher;
        set_ray(to_catcher.ray, eye, direction, select(hit, load(rays.ray.tfar), Float(far_away)), Int(catcher_mask));
        const Bool caught = trace(scene, scene.catchers, make_query(Coherence::coherent, true), to_catcher, rest);
        if (any(caught)) {
            const CatcherShadow shadow = catcher_shadow(work.frame, to_catcher, caught, random_of(work, paths));
            alpha = select(caught, shadow.alpha, alpha);
            if (scene.coloured_shadows)
                add_radiance(work, paths, shadow.colour, caught);
        }
    }
    if (any(is_virtual))
        shade(work, rays, is_virtual, paths);
    return alpha;
}

// Loads a block's ray directions or their derivatives. `z`: the z component if only x and y are stored.
ARHOST_INLINE Vec3 load_rays(const float *arrays, std::int32_t dimensions, float z) {
    return {load(arrays), load(arrays + lanes), dimensions == 3 ? load(arrays + 2 * lanes) : Float(z)};
}

ARHOST_INLINE Vec3 direction_in_world(const Frame &frame, const float *rays, std::uint32_t sample) {
    const std::int32_t dimensions = frame.rays.dimensions, step = lanes * dimensions;
    Vec3 direction = load_rays(rays, dimensions, 1);
    if (frame.rays.has_derivatives)
        direction = direction + load_rays(rays + step, dimensions, 0) * Float(frame.samples[sample].x) +
                    load_rays(rays + 2 * step, dimensions, 0) * Float(frame.samples[sample].y);
    return transform(frame.camera.world_from_camera, direction);
}

ARHOST_INLINE Int srgb8(const arhost::shading::Srgb8Table &table, Float linear) {
    using Table = arhost::shading::Srgb8Table;
    const Int bits = bits_of(min(max(linear, Float(Table::smallest)), Float(1.0f)));
    const Int cell = gather(table.cells, (bits - Int(Table::first_bits)) >> Int(Table::shift));
    const Bool above = (bits & Int(Table::low_mask)) >= (cell & Int(Table::threshold_mask));
    return (cell >> Int(Table::code_shift)) + select(above, Int(1), Int(0));
}

ARHOST_INLINE Int rgba8(Int r, Int g, Int b, Int a) {
    return r | (g << Int(8)) | (b << Int(16)) | (a << Int(24));
}

ARHOST_INLINE Vec3 radiance_of(const Scratch &scratch, int first_pixel) {
    return {load(scratch.radiance[0] + first_pixel), load(scratch.radiance[1] + first_pixel),
            load(scratch.radiance[2] + first_pixel)};
}

// Returns a block's RGBA pixels for images with a single sample per pixel.
ARHOST_INLINE Int encode(const Frame &frame, const Scratch &scratch, int first_pixel, bool coloured) {
    const Int alpha = to_int(code_8bit(load(scratch.alpha + first_pixel)));
    if (!coloured)
        return alpha << Int(24);
    const Vec3 radiance = radiance_of(scratch, first_pixel);
    const auto &table = *frame.scene.srgb8;
    return rgba8(srgb8(table, radiance.x), srgb8(table, radiance.y), srgb8(table, radiance.z), alpha);
}

// Adds the current sample to the pixels' sums. Colours are sRGB-encoded and premultiplied, as the compositor blends
// them.
ARHOST_INLINE void accumulate(Scratch &scratch, int first_pixel, bool coloured, bool first) {
    const Float alpha = load(scratch.alpha + first_pixel);
    Vec3 colour = black();
    if (coloured) {
        const Vec3 radiance = radiance_of(scratch, first_pixel);
        colour = Vec3{srgb_encode(radiance.x), srgb_encode(radiance.y), srgb_encode(radiance.z)} * alpha;
    }
    const Float values[4] = {colour.x, colour.y, colour.z, alpha};
    for (int i = 0; i < 4; ++i) {
        float *to = scratch.sum[i] + first_pixel;
        store(to, first ? values[i] : load(to) + values[i]);
    }
}

// Adds the sums of previous frames to the sums of this frame, and stores the totals for the next frame. A frame has
// no samples once accumulation is complete; its totals are those of the previous frame.
ARHOST_INLINE void add_history(const Frame &frame, Scratch &scratch, std::size_t first_of_tile, int first_pixel) {
    for (int i = 0; i < 4; ++i) {
        float *kept = frame.history[i] + first_of_tile + first_pixel, *sum = scratch.sum[i] + first_pixel;
        if (frame.sample_count == 0)
            store(sum, load(kept));
        else if (frame.first_sample > 0)
            store(sum, load(kept) + load(sum));
        store(kept, load(sum));
    }
}

ARHOST_INLINE Int mean(const Scratch &scratch, int first_pixel, std::uint32_t count) {
    const Float alpha = load(scratch.sum[3] + first_pixel);
    // Dividing the summed colour by the summed alpha gives a colour with straight alpha: the sample count cancels
    // out.
    const Float scale = Float(1.0f) / max(alpha, Float(1e-6f));
    const auto code = [&](int i) __attribute__((always_inline)) {
        return to_int(code_8bit(load(scratch.sum[i] + first_pixel) * scale));
    };
    return rgba8(code(0), code(1), code(2), to_int(code_8bit(alpha * Float(1.0f / static_cast<float>(count)))));
}

ARHOST_INLINE void write_block(const Frame &frame, int x, int y, int width, int height, Int pixels) {
    const auto *from = reinterpret_cast<const std::uint8_t *>(&pixels);
    for (int row = 0; row < height; ++row) {
        std::uint8_t *to = frame.rgba + std::size_t{frame.stride} * (y + row) + std::size_t{4} * x;
        if (width == block)
            __builtin_memcpy(to, from + 4 * block * row, 4 * block);
        else
            __builtin_memcpy(to, from + 4 * block * row, 4 * width);
    }
}

// Calls use(index, x, y, width, height) for each block, row by row. Blocks at the right and bottom edges may be
// smaller than 4×4 pixels.
template <class Use> ARHOST_INLINE void for_each_block(const Rectangle &all, Use use) {
    int index = 0;
    for (int y = all.y0; y < all.y1; y += block)
        for (int x = all.x0; x < all.x1; x += block, ++index)
            use(index, x, y, all.x1 - x < block ? all.x1 - x : block, all.y1 - y < block ? all.y1 - y : block);
}

} // namespace

Rectangle render_tile(const Frame &frame, const Tile &tile, Scratch &scratch) {
    const Int column = lane_numbers() & Int(3), row = lane_numbers() >> Int(2);
    const Rectangle &all = tile.pixels;
    Rectangle drawn{all.x1, all.y1, all.x0, all.y0};
    const float *rays = frame.rays.blocks + tile.first_block * frame.rays.block_size();
    Work work{frame, scratch, 0, Int(all.x0 * 65536 + all.y0) ^ Int(0x51ed270b), 0};
    bool coloured[tile_pixels / lanes];
    const bool has_sums = frame.sample_count != 1 || frame.history[0];

    for (std::int32_t i = 0; i < frame.sample_count; ++i) {
        work.sample = frame.first_sample + static_cast<std::uint32_t>(i);
        for_each_block(all, [&](int number, int, int, int width, int height) {
            const int first_pixel = number * lanes;
            const Vec3 direction = direction_in_world(frame, rays + number * frame.rays.block_size(), i);
            const Bool inside = (column < Int(width)) & (row < Int(height)) &
                                (direction.x == direction.x); // false if NaN: the pixel has no ray
            store(scratch.alpha + first_pixel, primary(work, first_pixel, direction, inside, coloured[number]));
        });
        trace_queued_rays(work);
        if (has_sums)
            for_each_block(all, [&](int number, int, int, int, int) {
                accumulate(scratch, number * lanes, coloured[number], i == 0);
            });
    }
    for_each_block(all, [&](int number, int x, int y, int width, int height) {
        const int first_pixel = number * lanes;
        if (frame.history[0])
            add_history(frame, scratch, tile.first_block * lanes, first_pixel);
        const Int pixels =
            has_sums ? mean(scratch, first_pixel, frame.first_sample + static_cast<std::uint32_t>(frame.sample_count))
                     : encode(frame, scratch, first_pixel, coloured[number]);
        write_block(frame, x, y, width, height, pixels);
        if (any((pixels >> Int(24)) != Int(0))) { // lanes outside the image have alpha 0
            drawn.x0 = x < drawn.x0 ? x : drawn.x0;
            drawn.y0 = y < drawn.y0 ? y : drawn.y0;
            drawn.x1 = x + width > drawn.x1 ? x + width : drawn.x1;
            drawn.y1 = y + height > drawn.y1 ? y + height : drawn.y1;
        }
    });
    return drawn;
}

} // namespace rt_embree::ARHOST_ISA
