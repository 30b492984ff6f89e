// SPDX-License-Identifier: Apache-2.0
//
// The simulated camera: samples the image of the desk through the lens model, then applies vignetting, blur, noise
// and the sRGB curve.
#pragma once

#include "desk.hpp"
#include "path.hpp"

#include <arhost/camera.h>

#include <optional>
#include <span>
#include <vector>

namespace arhost::synthetic {

struct Sensor {
    double blur_px; // sigma of the lens blur in px
    double noise;   // 1: like a small camera indoors
    double exposure_ev;
    std::uint64_t seed;
};

// The pose of the card on the desk.
struct Card {
    Point at, x_axis;
};

struct Shot {
    std::span<const Mt>
        poses; // in desk units; if there are several, the frame is the mean of their images (motion blur)
    std::optional<Card> card;
    std::uint64_t sequence; // selects the noise
};

class Renderer {
public:
    Renderer(DeskTextures textures, const arhost_intrinsics &camera, const Sensor &sensor, int threads);

    // Renders a frame to `bgr`, whose rows are `stride` bytes apart.
    void render(const Shot &shot, uint8_t *bgr, std::size_t stride) const;

private:
    struct Node { // a node of the coarse grid, for quantities that vary slowly over the image
        float step_u, step_v, lod;
        float gain;       // vignetting
        float reflection; // light to add where the gloss is 1
    };
    struct Plane { // maps a ray to the desk: (u, v) = (row 0 · ray, row 1 · ray) / (row 2 · ray)
        std::array<std::array<float, 3>, 3> row;
        Vec3 eye;
        std::array<Vec3, 3> axes; // camera axes (x right, y down, z forward) in desk coordinates
    };
    struct Frame;

    static Plane plane_of(const Mt &pose);
    std::vector<Node> nodes_of(const Plane &plane) const;
    void warp_span(int x, int y, const Frame &frame, Texel16 *out) const;
    struct Scratch;
    void develop_row(int y, const Frame &frame, Scratch &scratch, uint8_t *bgr) const;

    DeskTextures textures_;
    int width_, height_, threads_;
    int padded_; // width + 1, rounded up to whole spans
    // Ray directions at every lens_px-th pixel, which are interpolated linearly. (0, 0, 0) where no light arrives.
    static constexpr int lens_px = 4;
    int lens_columns_;
    std::vector<float> ray_[3];
    int grid_width_, grid_height_;
    double focal_px_;
    // Blur weights: first that of the centre, then one for each pair of neighbours. Each entry has one weight per
    // channel, repeated for two pixels.
    std::vector<std::array<uint16_t, 8>> kernel_;
    // The following tables use light in units of full_scale.
    std::vector<uint8_t> srgb_;                 // sRGB codes, indexed by the square root of light
    float shot_, read2_;                        // noise variance = shot_·light + read2_
    std::vector<std::array<int16_t, 4>> grain_; // tileable noise
    std::uint64_t seed_;
};

} // namespace arhost::synthetic
