// SPDX-License-Identifier: Apache-2.0
//
// The integrator, which renders a tile in blocks of 4×4 pixels. base.cpp, avx2.cpp and avx512.cpp each define
// ARHOST_ISA and include this file.
#include "kernel.hpp"

#include "raytracer_common/packets/packet.hpp"

#define ARHOST_TEXT_OF(token) #token
#define ARHOST_TEXT(macro) ARHOST_TEXT_OF(macro)

namespace rt_embree::ARHOST_ISA {

using namespace arhost::raytracer_common::ARHOST_ISA;

namespace {

// Included inside the namespace so that each instruction set has its own copy of the functions.
#include "primary.inl"

// Traces the primary rays of a block and shades their hits. Returns whether any of the pixels can have radiance.
ARHOST_INLINE bool trace_primary_and_shade(Work &work, int first_pixel, Vec3 direction, Bool active, Bool near) {
    const Paths paths{lane_numbers() + Int(first_pixel), first_pixel, white(), 0, Float(0.0f)};
    const PrimaryHits hits = trace_primary(work.frame.scene, splat(work.frame.camera.eye), direction, active, near);
    if (any(hits.caught)) {
        const CatcherLight light = catcher_light(work.frame, hits.catcher_rays, hits.caught, random_of(work, paths));
        const Vec3 hidden = select(hits.caught, light.hidden, black());
        add_to_sum(work.scratch, caught_row, first_pixel, select(hits.caught, Float(1.0f), Float(0.0f)));
        add_to_sum(work.scratch, irradiance_row, first_pixel, select(hits.caught, light.irradiance, Float(0.0f)));
        add_to_sum(work.scratch, hidden_row, first_pixel, hidden.x);
        add_to_sum(work.scratch, hidden_row + 1, first_pixel, hidden.y);
        add_to_sum(work.scratch, hidden_row + 2, first_pixel, hidden.z);
    }
    if (!any(hits.is_virtual))
        return false;
    for (float *plane : work.scratch.radiance)
        store(plane + first_pixel, Float(0.0f));
    add_to_sum(work.scratch, coverage_row, first_pixel, select(hits.is_virtual, Float(1.0f), Float(0.0f)));
    shade(work, hits.rays, hits.is_virtual, paths);
    return true;
}

// Loads a block's ray directions or their derivatives. `z`: the z component if only x and y are stored.
ARHOST_INLINE Vec3 load_rays(const float *arrays, std::int32_t dimensions, float z) {
    return {load(arrays), load(arrays + lanes), dimensions == 3 ? load(arrays + 2 * lanes) : Float(z)};
}

// Returns the ray directions of a block, in camera axes, through points that are (x, y) px from the pixels' centres.
ARHOST_INLINE Vec3 direction_in_camera(const Frame &frame, const float *rays, float x, float y) {
    const std::int32_t dimensions = frame.rays.dimensions, step = lanes * dimensions;
    Vec3 direction = load_rays(rays, dimensions, 1);
    if (frame.rays.has_derivatives)
        direction = direction + load_rays(rays + step, dimensions, 0) * Float(x) +
                    load_rays(rays + 2 * step, dimensions, 0) * Float(y);
    return direction;
}
ARHOST_INLINE Vec3 direction_in_world(const Frame &frame, const float *rays, float x, float y) {
    return transform(frame.camera.world_from_camera, direction_in_camera(frame, rays, x, y));
}

// Adds the radiance of the current sample to the pixels' sums. Radiance is averaged in linear light and encoded only
// once. sRGB codes are not linear and limited to 1, so averaging them would darken noise and highlights.
ARHOST_INLINE void accumulate_radiance(Scratch &scratch, int first_pixel) {
    for (int i = 0; i < 3; ++i)
        add_to_sum(scratch, light_row + i, first_pixel, bounded_radiance(load(scratch.radiance[i] + first_pixel)));
}

// Adds the sums of previous frames to the sums of this frame, and stores the totals for the next frame. Once
// accumulation is complete, a frame has no samples of its own; its totals are those of the previous frame.
ARHOST_INLINE void add_history(const Frame &frame, Scratch &scratch, std::size_t first_of_tile, int first_pixel) {
    for (int i = 0; i < frame.scene.sum_row_count(); ++i) {
        float *kept = frame.history[i] + first_of_tile + first_pixel, *sum = scratch.sum[i] + first_pixel;
        if (frame.first_sample > 0)
            store(sum, load(kept) + load(sum));
        store(kept, load(sum));
    }
}

// The overlay at shadow catchers.
struct CatcherShadow {
    Float alpha;
    Vec3 colour; // sRGB-encoded
};

ARHOST_INLINE CatcherShadow catcher_shadow(const Scene &scene, const Scratch &scratch, int first_pixel) {
    const Float irradiance = load(scratch.sum[irradiance_row] + first_pixel);
    Float fraction[3];
    for (int i = 0; i < 3; ++i)
        fraction[i] = fraction_of(load(scratch.sum[hidden_row + i] + first_pixel), irradiance);
    const Float opaque = scene.shadow_alpha_opaque, translucent = scene.shadow_alpha_translucent;
    if (!scene.coloured_shadows)
        return {shadow_alpha(fraction[0], fraction[1], opaque, translucent), black()};
    // Each colour channel has its own alpha, but the image has one alpha for all channels: the largest. This alpha
    // would darken the other channels too much, so the shadow's colour compensates for the difference.
    Vec3 of_channel;
    of_channel.x = shadow_alpha(fraction[0], Float(0.0f), opaque, translucent);
    of_channel.y = shadow_alpha(fraction[1], Float(0.0f), opaque, translucent);
    of_channel.z = shadow_alpha(fraction[2], Float(0.0f), opaque, translucent);
    const Float alpha = largest(of_channel);
    return {alpha,
            {shadow_colour_encoded(of_channel.x, alpha), shadow_colour_encoded(of_channel.y, alpha),
             shadow_colour_encoded(of_channel.z, alpha)}};
}

// Returns a block's RGBA pixels, the means of `count` samples. Virtual objects and catchers are averaged separately.
// They are then blended in sRGB, weighted by their shares of the pixel, as the compositor blends them with the video.
// Edges thus have no halo on any background.
ARHOST_INLINE Int mean(const Frame &frame, const Scratch &scratch, int first_pixel, std::uint32_t count) {
    const Scene &scene = frame.scene;
    const Float samples(static_cast<float>(count)), covered = load(scratch.sum[coverage_row] + first_pixel);
    const Float coverage = covered * Float(1.0f / static_cast<float>(count));
    Vec3 light = black();
    Int red(0), green(0), blue(0);
    if (any(covered > Float(0.0f))) {
        const Float per_hit = Float(1.0f) / max(covered, Float(1.0f));
        light.x = load(scratch.sum[light_row] + first_pixel) * per_hit;
        light.y = load(scratch.sum[light_row + 1] + first_pixel) * per_hit;
        light.z = load(scratch.sum[light_row + 2] + first_pixel) * per_hit;
        red = srgb8(*frame.image.srgb8, light.x);
        green = srgb8(*frame.image.srgb8, light.y);
        blue = srgb8(*frame.image.srgb8, light.z);
    }
    Float alpha = coverage;
    if (scene.has_catchers) {
        const Float caught = load(scratch.sum[caught_row] + first_pixel);
        Bool shadowed = bool_of(false);
        for (int i = 0; i < 3; ++i)
            shadowed = shadowed | (load(scratch.sum[hidden_row + i] + first_pixel) > Float(0.0f));
        if (any(shadowed)) {
            const CatcherShadow shadow = catcher_shadow(scene, scratch, first_pixel);
            const Float more = select(shadowed, shadow.alpha * fraction_of(caught, samples), Float(0.0f));
            alpha = coverage + more;
            const Float scale = Float(1.0f) / max(alpha, Float(1e-6f));
            const auto blended = [&](Int object, Float linear, Float encoded_shadow) __attribute__((always_inline)) {
                const Float colour = (srgb_encode(linear) * coverage + encoded_shadow * more) * scale;
                return select(shadowed, to_int(code_8bit(colour)), object);
            };
            red = blended(red, light.x, shadow.colour.x);
            green = blended(green, light.y, shadow.colour.y);
            blue = blended(blue, light.z, shadow.colour.z);
        }
    }
    return rgba8(red, green, blue, to_int(code_8bit(alpha)));
}

ARHOST_INLINE void write_block(const Frame &frame, int x, int y, int width, int height, Int pixels) {
    const auto *from = reinterpret_cast<const std::uint8_t *>(&pixels);
    for (int row = 0; row < height; ++row) {
        std::uint8_t *to = frame.image.rgba + std::size_t{frame.image.stride} * (y + row) + std::size_t{4} * x;
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

#include "denoiser_input.inl"
#include "region.inl"
#include "specular_edges.inl"

struct Whitted {
    template <class DirectionAt>
    static ARHOST_INLINE bool primary(Work &work, int first_pixel, Vec3 direction, DirectionAt, Bool active,
                                      Bool near) {
        return trace_primary_and_shade(work, first_pixel, direction, active, near);
    }
    static ARHOST_INLINE void finish_primary(Work &) {}
    static ARHOST_INLINE void trace_packet(Work &work, std::uint32_t depth) { trace_queued_packet(work, depth); }
    static ARHOST_INLINE void accumulate(const Frame &, Scratch &scratch, int first_pixel) {
        accumulate_radiance(scratch, first_pixel);
    }
    static ARHOST_INLINE bool write(const Frame &frame, const Scratch &scratch, int first_pixel, std::uint32_t count,
                                    int x, int y, int width, int height) {
        const Int pixels = mean(frame, scratch, first_pixel, count);
        write_block(frame, x, y, width, height, pixels);
        return any((pixels >> Int(24)) != Int(0)); // lanes outside the image have alpha 0
    }
};

struct Path {
    template <class DirectionAt>
    static ARHOST_INLINE bool primary(Work &work, int first_pixel, Vec3 direction, DirectionAt direction_at,
                                      Bool active, Bool near) {
        return primary_path(work, first_pixel, direction, direction_at, active, near);
    }
    static ARHOST_INLINE void finish_primary(Work &work) { sample_deferred(work); }
    static ARHOST_INLINE void trace_packet(Work &work, std::uint32_t depth) { trace_path_packet(work, depth); }
    static ARHOST_INLINE void accumulate(const Frame &frame, Scratch &scratch, int first_pixel) {
        accumulate_path(frame, scratch, first_pixel);
    }
    static ARHOST_INLINE bool write(const Frame &frame, const Scratch &scratch, int first_pixel, std::uint32_t count,
                                    int x, int y, int width, int height) {
        if (frame.denoising) {
            write_for_denoiser(frame, scratch, first_pixel, count, x, y, width, height);
            return false;
        }
        const LinearBlock linear = linear_mean(frame, scratch, first_pixel, count, x, y);
        if (frame.image.linear)
            return write_linear(frame.image, x, y, width, height, linear);
        const Int pixels = straight_of(frame.image, linear);
        write_block(frame, x, y, width, height, pixels);
        return any((pixels >> Int(24)) != Int(0));
    }
};

// Integrator::primary traces the primary rays of a block, and returns whether `accumulate` is to be called for it.
// Integrator::write writes a block of the image, and returns whether virtual objects affect it.
template <class Integrator> ARHOST_INLINE Rectangle render(const Frame &frame, const Tile &tile, Scratch &scratch) {
    const Rectangle &all = tile.pixels;
    Rectangle drawn{all.x1, all.y1, all.x0, all.y0};
    const float *rays = frame.rays.blocks + tile.first_block * frame.rays.block_size();
    Work work{frame, scratch,
              0,     (static_cast<std::uint32_t>(all.x0) * 65536u + static_cast<std::uint32_t>(all.y0)) ^ 0x51ed270bu,
              0,     0};
    bool has_light[tile_pixels / lanes], unchanged[tile_pixels / lanes] = {};
    if (frame.path.wide_catcher >= 0 && find_unchanged(frame, tile, scratch, unchanged)) {
        for_each_block(
            all, [&](int, int x, int y, int width, int height) { write_unchanged(frame, x, y, width, height); });
        return drawn;
    }
    for (int i = 0; i < frame.scene.sum_row_count(); ++i)
        __builtin_memset(scratch.sum[i], 0, tile_pixels * sizeof(float));
    if (frame.denoising) {
        for (float *row : scratch.guide)
            __builtin_memset(row, 0, tile_pixels * sizeof(float));
        for (float *row : scratch.seen)
            __builtin_memset(row, 0, tile_pixels * sizeof(float));
    }

    for (std::int32_t i = 0; i < frame.sample_count; ++i) {
        work.index = static_cast<std::uint32_t>(i);
        work.sample = frame.first_random + work.index;
        for_each_block(all, [&](int number, int, int, int width, int height) {
            const float *block_rays = rays + number * frame.rays.block_size();
            const auto direction_at = [&](float x, float y) __attribute__((always_inline)) {
                return direction_in_world(frame, block_rays, x, y);
            };
            has_light[number] = false;
            if (unchanged[number])
                return;
            const Vec3 in_camera =
                frame.denoising ? direction_in_camera(frame, block_rays, 0, 0)
                                : direction_in_camera(frame, block_rays, frame.samples[i].x, frame.samples[i].y);
            const Vec3 direction = transform(frame.camera.world_from_camera, in_camera);
            const Bool inside =
                inside_block(width, height) & (direction.x == direction.x); // false if NaN: the pixel has no ray
            has_light[number] = Integrator::primary(work, number * lanes, direction, direction_at, inside,
                                                    in_windows(scratch.virtual_windows, in_camera, inside));
        });
        Integrator::finish_primary(work);
        trace_queued_rays(work, [](Work &of, std::uint32_t depth) { Integrator::trace_packet(of, depth); });
        for_each_block(all, [&](int number, int, int, int, int) {
            if (has_light[number])
                Integrator::accumulate(frame, scratch, number * lanes);
        });
        if (!frame.goes_on(frame.progress))
            break;
    }
    if (frame.denoising)
        smooth_specular_edges(work, tile);
    const std::uint32_t count = frame.first_sample + static_cast<std::uint32_t>(frame.sample_count);
    for_each_block(all, [&](int number, int x, int y, int width, int height) {
        const int first_pixel = number * lanes;
        if (unchanged[number])
            return write_unchanged(frame, x, y, width, height);
        if (frame.history[0])
            add_history(frame, scratch, tile.first_block * lanes, first_pixel);
        if (Integrator::write(frame, scratch, first_pixel, count, x, y, width, height)) {
            drawn.x0 = x < drawn.x0 ? x : drawn.x0;
            drawn.y0 = y < drawn.y0 ? y : drawn.y0;
            drawn.x1 = x + width > drawn.x1 ? x + width : drawn.x1;
            drawn.y1 = y + height > drawn.y1 ? y + height : drawn.y1;
        }
    });
    return drawn;
}

void trace_photons(const Frame &frame, std::uint32_t first, std::uint32_t count, Photon *to, std::int8_t *faces) {
    for (std::uint32_t i = 0; i < count; i += lanes)
        trace_photon_packet(frame, first + i, to + i, faces + i, lane_numbers() < Int(static_cast<int>(count - i)));
}

} // namespace

Kernel kernel() {
    return {render<Whitted>, render<Path>, trace_photons, remember, find_taps, ARHOST_TEXT(ARHOST_ISA)};
}

} // namespace rt_embree::ARHOST_ISA
