// SPDX-License-Identifier: Apache-2.0
//
// The kernel's input. It consists of plain data only: the kernel is compiled once per instruction set, and must not
// share inline functions with other code (raytracer_common/packets/packet.hpp).
#pragma once

#include "embree.hpp"
#include "raytracer_common/denoiser/layers.hpp"
#include "raytracer_common/photon_map.hpp"
#include "raytracer_common/samples.hpp"
#include "raytracer_common/source_record.hpp"

#include <arhost/scene.h>
#include <arhost/shading/srgb8.hpp>

#include <cstddef>
#include <cstdint>

namespace rt_embree {

using namespace arhost::raytracer_common;

// Bits of Embree's ray and geometry masks. A ray can hit an object only if their masks have a common bit.
enum RoleMask : unsigned {
    opaque_mask = 1, // virtual objects except glass
    glass_mask = 2,  // virtual objects of glass
    catcher_mask = 4,
    occluder_mask = 8,
    virtual_masks = opaque_mask | glass_mask,
    real_masks = catcher_mask | occluder_mask,
    all_masks = 15
};

// An object of the scene. `Scene::objects` is indexed by Embree's geometry or instance ID.
struct Object {
    const arhost_material *material;
    arhost_role role;
    bool has_transform;
    // 3×3 matrices from object to world space, column-major. `transform` is for directions; `normal_transform`, its
    // inverse transpose, is for normals.
    float transform[9], normal_transform[9];
    float extent[3];        // result of object_extent() (raytracer_common/scene_geometry.hpp)
    const int *indices;     // three vertex indices per triangle
    const float *positions; // vertex positions
    const float *normals;   // NULL if flat-shaded or a sphere
    const float *texcoords; // NULL if absent; sets follow each other
    const float *tangents;  // NULL if absent: four floats per vertex
    const int *colours;     // NULL if absent: two ints per vertex, red and green, blue and opacity, 16 bits each
    bool blends, has_coat, has_sheen, is_anisotropic, has_film; // with the path integrator
    // Light samples of the path integrator: their expected number per unit of the emissive mesh's area (1/mm²), or on
    // a ball; 0 if the object is not sampled as a light source. Radius of the ball in world space, mm; 0: a mesh.
    float emitter_density, ball_radius;
    std::uint32_t position_stride, normal_stride, index_stride, texcoord_stride, tangent_stride, colour_stride;
    std::uint32_t vertex_count;
};

struct Environment {
    const Texture *image; // NULL if the scene has no environment
    float intensity[3];   // multiplies the texels
    float environment_from_world[9];
    const float *rows, *columns; // cumulative sums for importance sampling (arhost/scene.h)
};

// Sums over the samples of a pixel.
enum SumRow : int {
    light_row,        // three rows: linear radiance of the virtual objects
    coverage_row = 3, // number of samples that hit a virtual object; the remaining rows are unused without catchers
    caught_row,       // number of samples that hit a catcher
    irradiance_row,   // irradiance of the catcher without shadows
    // Three rows: the parts of irradiance_row that virtual objects hide. With coloured shadows, there is one part per
    // colour channel. Otherwise, the rows are the part that opaque objects hide, the part that translucent objects
    // hide, and 0.
    hidden_row,
    // Path integrator, instead of the rows from caught_row on. Three rows each: the change of a catcher's diffuse
    // light relative to its light without virtual objects; of glossy catchers, the light that they mirror only
    // without virtual objects, and their diffuse light without them.
    change_row = caught_row,
    covered_row = change_row + 3,
    matt_row = covered_row + 3,
    sum_rows = matt_row + 3
};

// The planes of Scratch::radiance, the results of a sample. The integrator `whitted` uses only the first.
enum Plane : int {
    object_plane,   // linear radiance of virtual objects
    change_plane,   // as change_row
    mirrored_plane, // light of virtual objects that a glossy catcher mirrors; part of light_row
    covered_plane,  // as covered_row
    plane_count
};

struct Scene {
    RTCScene root;
    RTCScene catchers;         // contains only the catchers; may be the same as `root`
    std::int32_t packet_width; // number of rays in Embree's native packets on this processor
    // Instance ID of the scene that contains all static objects, or −2 if there is no such scene. A static object's
    // index in `objects` is its geometry ID; a moving object's index is its instance ID.
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
    bool has_gloss;        // whether a catcher may mirror virtual objects
    bool has_several_real; // several catchers or occluders
    bool has_area_lights;
    bool has_image_levels; // of any texture
    float ray_angle;       // width of a sample from the eye, in units of its distance; 0: textures are not filtered
    std::uint32_t random_seed; // of the frame, for hits of translucent surfaces
    bool has_ambient;          // `ambient` is not black
    bool has_background;       // a background that is not black, and no environment
    int sum_row_count() const { return has_gloss ? sum_rows : has_catchers ? hidden_row + 3 : caught_row; }
    const float *linear_of_srgb8; // linear value of each of the 256 sRGB codes
};

// Ray directions in camera axes (x right, y down, z forward). They are stored tile by tile, and within a tile in
// blocks of 4×4 pixels. A block has an array of 16 x values, an array of 16 y values and, if `dimensions` is 3, an
// array of 16 z values; if `dimensions` is 2, z is 1. If `has_derivatives`, two more sets of such arrays follow: the
// derivatives along image rows, then those along image columns, per px. x is NaN for pixels to which the lens maps no
// direction.
struct Rays {
    const float *blocks;
    std::int32_t dimensions; // 2 or 3
    bool has_derivatives;
    std::int32_t block_size() const { return 16 * dimensions * (has_derivatives ? 3 : 1); }
};

// The mirrors and glass objects towards which lamps send photons.
struct Caustics {
    const float *spheres;              // centre and radius, mm
    const float *cumulative, *chances; // as in PhotonTargets
    std::int32_t sphere_count, lamp_count;
    float scene_extent;                       // mm: length of the diagonal of the scene's bounds
    std::uint32_t photon_count, first_number; // of this frame; offset into the random sequence
};

// As in PhotonMap.
struct PhotonGrid {
    const std::int32_t *numbers, *starts;
    std::int32_t bucket_mask; // number of buckets − 1
    float radius;
};
// See TracePhotons.
inline constexpr std::int32_t virtual_face = 6;

// The photons of one face in a cell of a grid whose side is twice the radius of a PhotonGrid.
struct PhotonCell {
    static constexpr int floats = 8;
    // Cells with more photons are replaced by those of the next level. A limit of a sample is at least this.
    static constexpr std::int32_t least_limit = 4;
    float power[3];     // sum
    float direction[3]; // sum of the directions along which they arrive, weighted by power
    std::int32_t count;
    std::uint32_t key; // of cell, face and level

    static std::uint32_t key_of(std::int32_t x, std::int32_t y, std::int32_t z, std::int32_t face,
                                std::int32_t level) {
        return static_cast<std::uint32_t>(x) * 2654435761u + static_cast<std::uint32_t>(y) * 2246822519u +
               static_cast<std::uint32_t>(z) * 3266489917u +
               static_cast<std::uint32_t>(8 * level + face) * 668265263u;
    }
    static std::uint32_t hash(std::uint32_t key) { return key ^ key >> 15; }
};
static_assert(sizeof(PhotonCell) == PhotonCell::floats * sizeof(float));

struct Photons {
    const float *photons; // nine floats each, as in Photon
    const std::int32_t *near;
    float low[3];
    PhotonGrid levels[PhotonMap::max_levels];
    std::int32_t level_count;
    // With denoising: a hash table of PhotonCell. A cell is at the index PhotonCell::hash() modulo its size, a power
    // of two, or follows it; a cell with count 0 ends the search. `near`, `low` and the radii of `levels` are set,
    // too.
    const float *cells;
    std::int32_t cell_mask; // size − 1
};

inline constexpr std::int32_t most_few_sources = 16;

// Input of the path integrator in addition to the scene.
struct PathScene {
    const float *sources;     // source_count records (raytracer_common/source_record.hpp)
    const float *few_sources; // source_rows rows of most_few_sources floats; null if there are more sources
    const float *cumulative;  // cumulative chances of the sources
    std::int32_t source_count;
    const float *lamp_chances; // of each lamp of the scene
    float environment_chance;
    // Irradiance of the environment's texels, not multiplied by its intensity, divided by π, of surfaces that face a
    // direction (RGBA32F).
    Texture irradiance;
    const float *spheres; // centre and radius of spheres that contain all virtual objects, mm
    std::int32_t sphere_count;
    float max_radiance; // bound of each sample
    // The change of a catcher's light is relative to at least this irradiance / π, so that a catcher in the dark does
    // not flicker (LightSources::least_irradiance). 0: catchers do not change.
    float least_irradiance;
    // The object that find_unchanged() of region.inl finds: a flat catcher; −1: none.
    std::int32_t wide_catcher;
    float brightest_texel; // of the environment, not multiplied by its intensity
    Video video;
    Caustics caustics;
    Photons photons;
};

// Memory of the video, for mirrors and glass: the light of points of a flat catcher, and of directions in which
// there is no real surface.
struct Surroundings {
    // Texels. The rows from plane_height on are directions in world axes, in equirectangular projection.
    static constexpr std::int32_t width = 256, plane_height = 256, height = 384;
    // Rows of texels: the light (three), and how certain it still is, from 0 to 1.
    static constexpr int certainty_row = 3, row_count = 4;
    // The certainty is halved after 140 frames.
    static constexpr float kept_per_frame = 0.995f, least_certainty = 1 / 64.0f;
    const float *before[row_count]; // NULL: nothing is known
    float *after[row_count];
    std::int32_t catcher; // its index in Scene::objects; −1: none
    std::int32_t axes[2]; // world axes of the plane
    // Coordinate of the plane along the third axis; the first texel's corner, and the sides of texels, along `axes`.
    float plane_mm, low[2], texel_mm[2];
    float side;       // 1 or −1: the side of the plane that is remembered, along the third axis
    bool knows_plane; // whether `before` has points of this plane
    int normal_axis() const { return 3 - axes[0] - axes[1]; }
};

struct Frame {
    Scene scene;
    Rays rays;
    Camera camera;
    const Sample *samples;
    std::int32_t sample_count;
    std::uint32_t first_sample; // number of samples accumulated before this frame; offset into the random sequences
    // Sums of accumulated samples, like Scratch::sum but for all tiles; NULL: no accumulation.
    float *history[sum_rows];
    std::int32_t light_samples; // samples per shaded point of each area light, the environment and the background
    bool single_path;           // glass spawns one random ray instead of two
    Image image;
    std::uint32_t first_random; // offset into the random sequences of the path integrator
    PathScene path;
    const Denoising *denoising;       // NULL: off
    const Surroundings *surroundings; // NULL: the video before is not known
    View view;                        // the picture if `denoising` is NULL
    // Called on any thread after each sample of a tile and before each chunk of photons, because a tile may take
    // seconds. Reports progress; returns whether the image is still wanted.
    bool (*goes_on)(const void *progress);
    const void *progress;
};

struct Tile {
    Rectangle pixels;
    std::size_t first_block; // index of the tile's first block in Rays::blocks
};

inline constexpr std::int32_t tile_side = 32, tile_pixels = tile_side * tile_side; // px

// Secondary rays of the same depth that wait to be traced. `values` consists of `rows` arrays, each with space for
// `capacity` rays.
struct RayQueue {
    // The rows are: origin, direction and throughput (three floats each), inverse density, and Paths::pixel (an int's
    // bits). The inverse density is the reciprocal of the density per steradian of the path's last random direction,
    // times the `sample_ratio` of enqueue_bounce(). It is 0 if there is no such direction (−0 if there were other
    // random choices), and negative if mirrors or glass have reflected or refracted the path since.
    static constexpr int rows = 11;
    float *values;
    std::int32_t count, capacity;
};

// Rays through the centres of pixels that wait to be sampled.
struct DeferredPixels {
    static constexpr int rows = 4; // direction, and the pixel's number in the tile (an int's bits)
    float *values[rows];
    std::int32_t count;
};

// Rectangles in the plane z = 1 of camera axes: bounds of the projections of objects. A ray through none of them
// meets none of these objects.
struct Windows {
    static constexpr std::int32_t most = 16;
    float bounds[most][4]; // x0, y0, x1, y1
    std::int32_t count;    // −1: unknown
};

// A thread's working memory for one tile. The arrays have one value per pixel, in the order of Rays::blocks.
struct Scratch {
    // Results of the current sample, per colour channel: plane_count planes of tile_pixels each.
    float *radiance[3];
    float *sum[sum_rows]; // sums over all samples
    // Of mirrors and glass, three rows, sums over all samples: the light that they show of lamps, the environment and
    // the video, and the albedo of the virtual objects that they show. Paths with random choices do not count.
    float *seen[3];
    float *guide[guide_rows];
    DeferredPixels catchers, objects; // to be sampled
    Windows virtual_windows;          // of virtual objects; unknown if there are occluders
    Windows windows;                  // of all objects but PathScene::wide_catcher and occluders
    RayQueue *queues;                 // one queue per depth, from 0 to Scene::max_depth
};

// Renders a tile. Returns the bounding rectangle of the pixels with non-zero alpha, enlarged to whole blocks of 4×4
// pixels. If there are no such pixels, the rectangle has x1 <= x0.
using RenderTile = Rectangle (*)(const Frame &frame, const Tile &tile, Scratch &scratch);

// Traces the photons with the numbers from `first` on. `to`, `faces`: one element per photon. The face of a photon is
// virtual_face if it arrived at a virtual surface. At a real one, it is 2 · axis of about the largest component of
// the normal, plus 1 if this component is positive.
using TracePhotons = void (*)(const Frame &frame, std::uint32_t first, std::uint32_t count, Photon *to,
                              std::int8_t *faces);

// Updates a row of Frame::surroundings.
using RememberRow = void (*)(const Frame &frame, std::int32_t row);
// Finds the taps of the denoiser in a tile.
using FindTaps = void (*)(const Frame &frame, const Tile &tile);

struct Kernel {
    RenderTile render_tile, render_path_tile;
    TracePhotons trace_photons;
    RememberRow remember_row;
    FindTaps find_taps;
    const char *name;
};

// The kernels of the instruction sets.
namespace base {
Kernel kernel();
}
namespace avx2 {
Kernel kernel();
}
namespace avx512 {
Kernel kernel();
}

} // namespace rt_embree
