// SPDX-License-Identifier: Apache-2.0
//
// What the kernel is given to trace a tile. Plain data, since the kernel is compiled for several
// instruction sets (kernel/packet.hpp).
#pragma once

#include "embree.hpp"
#include "raytracer_common/samples.hpp"

#include <arhost/scene.h>
#include <arhost/shading/srgb8.hpp>

#include <cstddef>
#include <cstdint>

namespace rt_embree {

// Bits of Embree's ray masks: which objects a ray can hit.
enum RoleMask : unsigned {
    opaque_mask = 1, // virtual objects, but for
    glass_mask = 2,  // those of glass
    catcher_mask = 4,
    occluder_mask = 8,
    virtual_masks = opaque_mask | glass_mask,
    all_masks = 15
};

// An object as the kernel needs it, looked up by Embree's geometry (or instance) number.
struct Object {
    const arhost_material *material;
    arhost_role role;
    bool has_transform;
    // Column-major, from the object to the world: of directions, and of normals (its inverse transposed).
    float transform[9], normal_transform[9];
    float reach[3];         // raytracer_common/arena.hpp
    const int *indices;     // of triangles
    const float *positions; // of their corners
    const float *normals;   // NULL where the object is flat or a sphere
    const float *texcoords; // NULL where there are none
    std::uint32_t position_stride, normal_stride, index_stride, texcoord_stride;
};

struct Texture {
    const void *texels; // RGBA8, sRGB or linear, or four floats
    std::int32_t width, height;
    arhost_texel_format format;
    arhost_wrap wrap_u, wrap_v;
};

struct Environment {
    const Texture *image; // NULL: there is none
    float intensity;
    float environment_from_world[9];
    const float *rows, *columns; // arhost/scene.h
};

struct Scene {
    RTCScene root;
    RTCScene catchers;         // nothing but the catchers, or the same as `root`
    std::int32_t packet_width; // Embree's
    // The instance that holds all objects that do not move, or −2: there is none. They have the numbers of
    // their geometries, others those of their instances.
    std::int32_t static_instance;
    const Object *objects;
    const Texture *textures;
    const arhost_light *lights;
    std::uint32_t light_count;
    Environment environment;
    std::uint32_t max_depth;
    float ambient[3], background[3];
    float shadow_alpha_opaque, shadow_alpha_translucent;
    bool coloured_shadows;
    bool has_catchers, has_occluders, has_glass;
    bool has_instances;
    const arhost::shading::Srgb8Table *srgb8;
    const float *linear_of_srgb8; // 256
};

// Directions in the camera's axes (x right, y down, z forward), in the order in which the kernel reads
// them: tile by tile, in each block by block of 4×4 pixels. A block is one array of 16 floats for each of
// x and y, z unless it is 1 throughout, then, unless there is one sample a pixel, the same of their slopes
// along the image's rows and of those along its columns, per px. x is NaN where the lens sees nothing.
struct Rays {
    const float *blocks;
    std::int32_t dimensions; // 2 or 3
    bool has_slopes;
    std::int32_t block_size() const { return 16 * dimensions * (has_slopes ? 3 : 1); }
};

struct Camera {
    float eye[3];
    float world_from_camera[9]; // column-major
};

struct Frame {
    Scene scene;
    Rays rays;
    Camera camera;
    const arhost::raytracer_common::Sample *samples;
    std::int32_t sample_count;
    std::uint32_t first_sample; // of all that are averaged: where in their random sequences these begin
    float *history[4];          // NULL, or the sums of the samples before, of all tiles' pixels (Scratch::sum)
    std::int32_t light_samples; // shadow rays to an extended light
    bool one_path;              // glass sends one ray on, chosen at random, in place of two
    std::uint8_t *rgba;
    std::uint32_t stride;
};

struct Rectangle {
    std::int32_t x0, y0, x1, y1; // px; x1 and y1 are outside
};

struct Tile {
    Rectangle pixels;
    std::size_t first_block; // of its rays
};

inline constexpr std::int32_t tile_side = 32, tile_pixels = tile_side * tile_side; // px

// Rays that wait to be traced, of one depth: `rows` arrays of `capacity` numbers.
struct WaitingRays {
    static constexpr int rows = 10; // origin, direction, throughput (floats), pixel (int)
    float *numbers;
    std::int32_t count, capacity;
};

// A thread's notes on the tile that it works at. Arrays of pixels are in the blocks' order.
struct Scratch {
    float *light[3], *alpha; // of one sample: linear, straight
    float *sum[4];           // of all: premultiplied, encoded; alpha
    WaitingRays *waiting;    // by depth, the scene's max_depth + 1 of them
};

// Traces and writes the pixels of a tile, and tells in which part of it (to 4 pixels) any alpha is not 0;
// an empty part has x1 <= x0.
using RenderTile = Rectangle (*)(const Frame &frame, const Tile &tile, Scratch &scratch);

struct Kernel {
    RenderTile render_tile;
    const char *name;
};

namespace base {
Rectangle render_tile(const Frame &frame, const Tile &tile, Scratch &scratch);
}
namespace avx2 {
Rectangle render_tile(const Frame &frame, const Tile &tile, Scratch &scratch);
}
namespace avx512 {
Rectangle render_tile(const Frame &frame, const Tile &tile, Scratch &scratch);
}

} // namespace rt_embree
