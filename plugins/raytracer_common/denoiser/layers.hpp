// SPDX-License-Identifier: Apache-2.0
//
// The memory of the denoiser as its steps see it: plain data, as in image.hpp.
#pragma once

#include "raytracer_common/image.hpp"

#include <cstddef>
#include <cstdint>

namespace arhost::raytracer_common {

// The content of an image, and the values of the option `show` in the same order.
enum class View : std::int32_t { picture, shadow, bounce, caustics, history, variance, normals };
inline constexpr const char *views[] = {"picture", "shadow",   "bounce",  "caustics",
                                        "history", "variance", "normals", nullptr};

// Kinds of surfaces.
enum SurfaceKind : std::int32_t {
    scattering_surface,
    specular_surface, // mirrors and glass
    real_surface,
    glossy_surface
};
constexpr std::int32_t surface_number(std::int32_t object, SurfaceKind kind) {
    return 4 * (object + 1) + kind;
}
constexpr std::int32_t most_surfaces = 1 << 20;
// Where a specular surface shows another one, its number is increased by this times (index of the latter + 1).
constexpr std::int32_t mirrored_unit = most_surfaces;
// The flat catcher (Denoising::flat_surface) where virtual objects do not change it.
constexpr std::int32_t unchanged_surface = most_surfaces - 4 + real_surface;

// Of the surface that the ray through the centre of a pixel meets, in a larger cell of one of its pixels, for the
// denoiser.
enum GuideRow : int {
    position_guide,                    // three rows: mm, in world axes
    normal_guide = position_guide + 3, // three rows: unit vector
    albedo_guide = normal_guide + 3,   // three rows: the factor of the denoised light; in mirrors and glass,
                                       // what they show (Denoising), if nothing moves a mean over frames
    surface_guide = albedo_guide + 3,  // an int's bits: number of the surface (surface_number()); 0: none;
                                       // unchanged_surface: the other guides and the light are not set
    guide_rows
};

// The denoised light of a surface: the radiance of a virtual one divided by its albedo, or the change of a catcher.
enum LightRow : int {
    variance_light = 3, // of the luminance of the three rows before; at first, whether it was sampled (`sampled`)
    light_rows
};

// Values of variance_light of light[0]: whether the light of a cell was sampled in this frame; if only because no
// other cell nearby shows its surface, it counts at new surfaces only, since its random numbers are those of its
// turn.
inline constexpr float not_sampled = 0, sampled = 1, sampled_early = 2;

// The memory of the denoiser: one value per cell of a layer.
enum HistoryRow : int {
    moment_history = 3, // two rows: means of the luminance of the light and of its square; the light precedes
    distance_history = moment_history + 2, // mm, from the camera to the surface
    normal_history,                        // an int's bits: packed_normal()
    surface_history,                       // as surface_guide
    frames_history,                        // number of frames in the means
    seen_history,                          // three rows: albedo_guide of mirrors and glass
    history_rows = seen_history + 3
};

// Sums over cells: the number of cells, and the difference between the luminance of the light in this frame and its
// mean before.
struct Change {
    float count, sum, squares;
};

enum class LayerLight : std::int32_t {
    objects, // radiance of virtual objects
    change,  // change of the diffuse light of catchers
    gloss    // light that glossy catchers mirror, minus what they mirror without virtual objects
};

// A grid of the denoiser. Histories have rows of `stride` values, a multiple of 16. Guides and light have `margin`
// more values on both sides of a row, without a surface.
struct Layer {
    static constexpr std::int32_t margin = 16;
    LayerLight holds;
    std::int32_t cell_px;               // side of a cell
    std::int32_t width, height, stride; // cells
    // Each cell gets light in one of four frames, except of surfaces that are sampled in every frame.
    bool takes_turns;
    float *guides[guide_rows];
    float *light[2][light_rows];       // each step of the filter reads one and writes the other
    const float *before[history_rows]; // of the previous frame; NULL: there is none
    float *after[history_rows];
    static constexpr std::int32_t change_side = 8;
    Change *changes; // of squares of change_side cells
    std::int32_t changes_per_row() const { return stride / change_side; }
    bool keeps_seen; // in seen_history
    int history_count() const { return keeps_seen ? history_rows : seen_history; }
    std::int32_t guide_stride() const { return stride + 2 * margin; }
    // Of the filter. Those of larger cells begin with wider steps.
    int filter_passes() const { return cell_px == 1 ? 5 : 4; }
};

struct Denoising {
    static constexpr std::size_t most_objects = most_surfaces / 4 - 2;
    static constexpr float most_frames = 32; // that count in the means
    // The light of virtual objects in each pixel, and that of catchers; if no lamp casts sharp shadows, in cells of
    // 2×2 pixels. The guides of `objects` are also those of catchers, except of the flat one. `gloss` exists only if
    // the scene has glossy catchers; it shares the guides of `catchers`, whose albedo is their diffuse light without
    // virtual objects.
    Layer objects, catchers, gloss;
    unsigned *taps; // of pixels at edges: see tap_count in layers.inl
    bool has_gloss; // whether `gloss` exists
    Camera camera, camera_before;
    Video video; // whose pixel grid covers that of the image
    Image image;
    View view;
    bool camera_moved, objects_moved;
    float pixel_angle;         // width of a pixel in the middle of the image, in units of its distance
    bool finds_change;         // whether to look for light that has changed
    std::int32_t flat_surface; // number of that of a flat catcher; 0: there is none
    // Catchers are sampled at one of each 2×2 pixels: 2 · (row mod 2) + column mod 2; −1: at all pixels. Likewise the
    // virtual objects; but mirrors and glass, whose history is short, always at all pixels.
    std::int32_t catcher_phase, object_phase;
    std::uint32_t number; // of the frame, without gaps
    // Offset into the random sequences of pixels that are sampled in every fourth frame.
    std::uint32_t first_random_in_turn;
    // For each object, 12 floats: the motion from this frame to the previous one, a column-major 3×4 matrix in world
    // axes. NULL if no placement has changed.
    const float *before_from_now;
    // Whether what curved mirrors and glass show may move over them.
    bool seen_moves() const { return camera_moved || objects_moved; }
};

} // namespace arhost::raytracer_common
