// SPDX-License-Identifier: Apache-2.0
//
// What the kernel is given to trace a tile. Plain data, since the kernel is compiled for several
// instruction sets (packet.hpp).
#pragma once

#include "embree.hpp"

#include <arhost/scene.h>
#include <arhost/shading/srgb8.hpp>

#include <cstddef>
#include <cstdint>

namespace rt_embree {

// Bits of Embree's ray masks: which objects a ray can hit.
enum RoleMask : unsigned { virtual_mask = 1, catcher_mask = 2, occluder_mask = 4, all_masks = 7 };

// An object as the kernel needs it, looked up by Embree's geometry (or instance) number.
struct Object {
    arhost_material material;
    arhost_role role;
    bool has_transform;
    // Takes normals from the object to the world: the inverse transposed, column-major.
    float normal_transform[9];
    // NULL where the object is flat or a sphere.
    const float *normals;
    const int *indices;
    std::uint32_t normal_stride, index_stride;
};

struct Scene {
    RTCScene root;
    std::int32_t packet_width; // Embree's
    const Object *objects;
    const arhost_light *lights;
    std::uint32_t light_count;
    std::uint32_t max_depth;
    float ambient[3], background[3];
    float shadow_alpha_opaque;
    bool has_catchers, has_occluders;
    bool has_instances;
    const arhost::shading::Srgb8Table *srgb8;
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

// Where in its pixel a sample lies, from the centre: −½ to ½.
struct Sample {
    float x, y;
};

struct Camera {
    float eye[3];
    float world_from_camera[9]; // column-major
};

struct Frame {
    Scene scene;
    Rays rays;
    Camera camera;
    const Sample *samples;
    std::int32_t sample_count;
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

// Traces and writes the pixels of a tile, and tells in which part of it (to 4 pixels) any alpha is not 0;
// an empty part has x1 <= x0.
using RenderTile = Rectangle (*)(const Frame &frame, const Tile &tile);

struct Kernel {
    RenderTile render_tile;
    const char *name;
};

namespace base {
Rectangle render_tile(const Frame &frame, const Tile &tile);
}
namespace avx2 {
Rectangle render_tile(const Frame &frame, const Tile &tile);
}
namespace avx512 {
Rectangle render_tile(const Frame &frame, const Tile &tile);
}

} // namespace rt_embree
