// SPDX-License-Identifier: Apache-2.0
//
// Input of the kernel. Plain data, since the kernel is compiled for several instruction sets (kernel/packet.hpp).
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
    opaque_mask = 1, // virtual objects except glass
    glass_mask = 2,  // virtual objects of glass
    catcher_mask = 4,
    occluder_mask = 8,
    virtual_masks = opaque_mask | glass_mask,
    all_masks = 15
};

// Indexed by Embree's geometry or instance ID.
struct Object {
    const arhost_material *material;
    arhost_role role;
    bool has_transform;
    // Column-major, object to world: for directions, and for normals (inverse transpose).
    float transform[9], normal_transform[9];
    float reach[3];         // raytracer_common/arena.hpp
    const int *indices;     // of triangles
    const float *positions; // of vertices
    const float *normals;   // NULL if flat-shaded or a sphere
    const float *texcoords; // NULL if absent
    std::uint32_t position_stride, normal_stride, index_stride, texcoord_stride;
};

struct Texture {
    const void *texels; // RGBA8, sRGB or linear, or four floats
    std::int32_t width, height;
    arhost_texel_format format;
    arhost_wrap wrap_u, wrap_v;
};

struct Environment {
    const Texture *image; // NULL: no environment
    float intensity;
    float environment_from_world[9];
    const float *rows, *columns; // arhost/scene.h
};

struct Scene {
    RTCScene root;
    RTCScene catchers;         // only the catchers, or the same as `root`
    std::int32_t packet_width; // native to Embree on this processor
    // The instance of all static objects, or −2 if none. Static objects are numbered by geometry ID, others by
    // instance ID.
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

// Directions in camera axes (x right, y down, z forward), in the kernel's order: by tile, then by block of 4×4
// pixels. A block is 16 floats each of x, y and, unless it is always 1, z; with several samples per pixel, followed
// by the same of the derivatives along image rows and along columns, per px. x is NaN for pixels that no direction
// maps to.
struct Rays {
    const float *blocks;
    std::int32_t dimensions; // 2 or 3
    bool has_derivatives;
    std::int32_t block_size() const { return 16 * dimensions * (has_derivatives ? 3 : 1); }
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
    std::uint32_t first_sample; // samples accumulated before this frame: offset into the random sequences
    float *history[4];          // NULL, or their sums for the pixels of all tiles (as Scratch::sum)
    std::int32_t light_samples; // shadow rays per area light
    bool single_path;           // glass spawns one random ray instead of two
    std::uint8_t *rgba;
    std::uint32_t stride;
};

struct Rectangle {
    std::int32_t x0, y0, x1, y1; // px; x1 and y1 are exclusive
};

struct Tile {
    Rectangle pixels;
    std::size_t first_block; // in Rays::blocks
};

inline constexpr std::int32_t tile_side = 32, tile_pixels = tile_side * tile_side; // px

// Secondary rays of one depth, in `rows` arrays of `capacity` values.
struct RayQueue {
    static constexpr int rows = 10; // origin, direction, throughput (floats), pixel index (bits of an int)
    float *values;
    std::int32_t count, capacity;
};

// A thread's working memory for one tile. Pixels are in block order.
struct Scratch {
    float *radiance[3], *alpha; // of one sample: linear, straight alpha
    float *sum[4];              // of all samples: sRGB-encoded, premultiplied; alpha
    RayQueue *queues;           // by depth, the scene's max_depth + 1 of them
};

// Renders a tile. Returns the bounding rectangle of its non-zero alphas, rounded out to blocks of 4×4 pixels; empty:
// x1 <= x0.
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
